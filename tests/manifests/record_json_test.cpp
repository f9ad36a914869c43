#include "manifests/record_json.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "manifests/verdict.h"

namespace q3d::manifests {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

SampleRecord make_record() {
  SampleRecord record;
  record.id = "animal3d/train/a/b.jpg#7";
  record.dataset = "animal3d";
  record.split = "train";
  record.source = "apt36k";
  record.species = "żubr";
  record.family = Family::bovidae;
  record.image_path = "/data/a/b.jpg";
  record.image_ref = "a/b.jpg";
  record.mask_path = "/data/a/b.png";
  record.width_px = 640;
  record.height_px = 480;
  record.box = {1.1, -2.0, 1.0 / 3.0, 400.0};
  for (std::size_t i = 0; i < record.keypoints.size(); ++i) {
    const auto x = static_cast<double>(i);
    record.keypoints[i] = {x / 7.0, x * 1e-9, i % 2 == 0 ? -1.0F : 2.0F, 0.1F * static_cast<float>(i)};
  }
  BodyTruth truth;
  truth.has_pose = true;
  truth.has_keypoints_3d = true;
  for (std::size_t i = 0; i < truth.pose_axis_angle.size(); ++i) {
    truth.pose_axis_angle[i] = std::sin(static_cast<float>(i));
  }
  truth.betas[40] = -0.7F;
  truth.trans = {0.1F, 0.2F, 8.0F};
  truth.keypoints_3d[77] = 3e-8F;
  record.truth = truth;
  record.failure = Reason::image_truncated;
  record.failure_detail = "ends at byte 12 of \"/data/a/b.jpg\"";
  return record;
}

SampleRecord through_text(const SampleRecord& record) {
  return json::parse(json(record).dump()).get<SampleRecord>();
}

TEST(RecordJson, KeepsEveryMemberThroughText) {
  const SampleRecord record = make_record();
  const SampleRecord read = through_text(record);
  EXPECT_EQ(read.id, record.id);
  EXPECT_EQ(read.dataset, record.dataset);
  EXPECT_EQ(read.split, record.split);
  EXPECT_EQ(read.source, record.source);
  EXPECT_EQ(read.species, record.species);
  EXPECT_EQ(read.family, record.family);
  EXPECT_EQ(read.image_path, record.image_path);
  EXPECT_EQ(read.image_ref, record.image_ref);
  EXPECT_EQ(read.mask_path, record.mask_path);
  EXPECT_EQ(read.width_px, record.width_px);
  EXPECT_EQ(read.height_px, record.height_px);
  EXPECT_EQ(read.box.x_px, record.box.x_px);
  EXPECT_EQ(read.box.y_px, record.box.y_px);
  EXPECT_EQ(read.box.w_px, record.box.w_px);
  EXPECT_EQ(read.box.h_px, record.box.h_px);
  for (std::size_t i = 0; i < record.keypoints.size(); ++i) {
    EXPECT_EQ(read.keypoints[i].x_px, record.keypoints[i].x_px);
    EXPECT_EQ(read.keypoints[i].y_px, record.keypoints[i].y_px);
    EXPECT_EQ(read.keypoints[i].v, record.keypoints[i].v);
    EXPECT_EQ(read.keypoints[i].weight, record.keypoints[i].weight);
  }
  ASSERT_TRUE(read.truth);
  EXPECT_TRUE(read.truth->has_pose);
  EXPECT_FALSE(read.truth->has_betas);
  EXPECT_TRUE(read.truth->has_keypoints_3d);
  EXPECT_EQ(read.truth->pose_axis_angle, record.truth->pose_axis_angle);
  EXPECT_EQ(read.truth->betas, record.truth->betas);
  EXPECT_EQ(read.truth->trans, record.truth->trans);
  EXPECT_EQ(read.truth->keypoints_3d, record.truth->keypoints_3d);
  EXPECT_EQ(read.failure, record.failure);
  EXPECT_EQ(read.failure_detail, record.failure_detail);
  EXPECT_EQ(record_digest(read), record_digest(record));
}

TEST(RecordJson, KeepsAbsentTruthAndNonFiniteNumbers) {
  SampleRecord record = make_record();
  record.truth.reset();
  record.keypoints[0].x_px = std::numeric_limits<double>::quiet_NaN();
  record.keypoints[1].y_px = std::numeric_limits<double>::infinity();
  record.box.w_px = -std::numeric_limits<double>::infinity();
  const SampleRecord read = through_text(record);
  EXPECT_FALSE(read.truth);
  EXPECT_TRUE(std::isnan(read.keypoints[0].x_px));
  EXPECT_EQ(read.keypoints[1].y_px, std::numeric_limits<double>::infinity());
  EXPECT_EQ(read.box.w_px, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(record_digest(read), record_digest(record));
}

// A good record, broken one member at a time.
TEST(RecordJson, NamesTheMemberThatIsBroken) {
  const json good = make_record();
  for (const auto& [member, value] : good.items()) {
    json broken = good;
    broken[member] = nullptr;
    EXPECT_THAT([&] { broken.get<SampleRecord>(); },
                ThrowsMessage<std::runtime_error>(HasSubstr("member \"" + member + "\"")));
    if (member == "truth") continue;
    broken.erase(member);
    EXPECT_THAT([&] { broken.get<SampleRecord>(); },
                ThrowsMessage<std::runtime_error>(HasSubstr("member \"" + member + "\"")));
  }
  json short_keypoints = good;
  short_keypoints["keypoints"].erase(0);
  EXPECT_THAT(
      [&] { short_keypoints.get<SampleRecord>(); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(make_record().id), HasSubstr("expected 26"))));
}

TEST(RecordDigest, ChangesWithEveryMemberThatMatters) {
  using Change = std::function<void(SampleRecord&)>;
  const std::vector<Change> changes{
      [](auto& r) { r.id += "x"; },
      [](auto& r) { r.dataset += "x"; },
      [](auto& r) { r.split += "x"; },
      [](auto& r) { r.source += "x"; },
      [](auto& r) { r.species += "x"; },
      [](auto& r) { r.family = Family::none; },
      [](auto& r) { r.image_ref += "x"; },
      [](auto& r) { r.mask_path.clear(); },
      [](auto& r) { ++r.width_px; },
      [](auto& r) { ++r.height_px; },
      [](auto& r) { r.box.x_px += 1e-12; },
      [](auto& r) { r.box.y_px += 1e-12; },
      [](auto& r) { r.box.w_px += 1e-12; },
      [](auto& r) { r.box.h_px += 1e-12; },
      [](auto& r) { r.keypoints[25].x_px += 1e-12; },
      [](auto& r) { r.keypoints[25].y_px += 1e-12; },
      [](auto& r) { r.keypoints[0].v = 1.0F; },
      [](auto& r) { r.keypoints[0].weight = 1.0F; },
      [](auto& r) { r.truth.reset(); },
      [](auto& r) { r.truth->has_pose = false; },
      [](auto& r) { r.truth->has_betas = true; },
      [](auto& r) { r.truth->has_keypoints_3d = false; },
      [](auto& r) { r.truth->pose_axis_angle[104] += 1e-6F; },
      [](auto& r) { r.truth->betas[0] += 1e-6F; },
      [](auto& r) { r.truth->trans[2] += 1e-6F; },
      [](auto& r) { r.truth->keypoints_3d[0] += 1e-6F; },
      [](auto& r) { r.failure = Reason::none; },
      // The same letters, split elsewhere between two members.
      [](auto& r) { r.dataset = "animal3dt", r.split = "rain"; },
  };
  std::set<std::string> digests{record_digest(make_record())};
  for (const Change& change : changes) {
    SampleRecord record = make_record();
    change(record);
    digests.insert(record_digest(record));
  }
  EXPECT_EQ(digests.size(), changes.size() + 1);
}

TEST(RecordDigest, StaysWhenTheFolderMoves) {
  SampleRecord moved = make_record();
  moved.image_path = "/elsewhere/a/b.jpg";
  moved.mask_path = "/elsewhere/a/b.png";
  moved.failure_detail = "ends at byte 12 of \"/elsewhere/a/b.jpg\"";
  EXPECT_EQ(record_digest(moved), record_digest(make_record()));
}

TEST(EnumNames, GoThereAndBackAndRefuseOthers) {
  for (int i = 0; i <= static_cast<int>(Reason::vetoed); ++i) {
    EXPECT_EQ(reason_from_string(to_string(static_cast<Reason>(i))), static_cast<Reason>(i));
  }
  for (int i = -1; i <= static_cast<int>(Family::hippopotamidae); ++i) {
    EXPECT_EQ(family_from_string(to_string(static_cast<Family>(i))), static_cast<Family>(i));
  }
  for (const auto verdict : {Verdict::retained, Verdict::refined, Verdict::discarded, Verdict::failed}) {
    EXPECT_EQ(verdict_from_string(to_string(verdict)), verdict);
  }
  for (const auto kind : {LabelKind::truth, LabelKind::retained, LabelKind::refined, LabelKind::two_d_only}) {
    EXPECT_EQ(label_kind_from_string(to_string(kind)), kind);
  }
  EXPECT_EQ(to_string(Reason::error_too_large), "error_too_large");
  EXPECT_EQ(to_string(Reason::prediction_not_finite), "prediction_not_finite");
  EXPECT_EQ(to_string(Family::none), "none");
  EXPECT_EQ(to_string(Family::equidae), "equidae");
  EXPECT_EQ(to_string(LabelKind::two_d_only), "2d_only");
  EXPECT_THAT([] { verdict_from_string("kept"); },
              ThrowsMessage<std::invalid_argument>(AllOf(HasSubstr("\"kept\""), HasSubstr("retained"))));
}

}  // namespace
}  // namespace q3d::manifests
