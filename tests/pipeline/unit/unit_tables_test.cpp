#include "pipeline/unit/unit_tables.h"

#include <gtest/gtest.h>

#include <cmath>

#include "smal/numbers.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::unit {
namespace {

// Distinct numbers in every field, so that a swapped or shifted column shows.
device::BodyPrediction numbered(float first) {
  device::BodyPrediction body;
  float value = first;
  const auto fill = [&]<typename Value>(Value& field) {
    smal::NumbersOf<Value> numbers;
    for (float& number : numbers) number = value += 0.25F;
    field = smal::from_numbers<Value>(numbers);
  };
  fill(body.pose);
  fill(body.betas);
  fill(body.camera);
  fill(body.translation);
  fill(body.keypoints_3d);
  fill(body.keypoints_2d);
  fill(body.aux_keypoints_2d);
  return body;
}

void expect_equal(const device::BodyPrediction& a, const device::BodyPrediction& b) {
  EXPECT_EQ(a.pose, b.pose);
  EXPECT_EQ(a.betas, b.betas);
  EXPECT_EQ(a.camera, b.camera);
  EXPECT_EQ(a.translation, b.translation);
  EXPECT_EQ(a.keypoints_3d, b.keypoints_3d);
  EXPECT_EQ(a.keypoints_2d, b.keypoints_2d);
  EXPECT_EQ(a.aux_keypoints_2d, b.aux_keypoints_2d);
}

TEST(UnitTables, PredictionsSurviveTheDisk) {
  const testing::ScratchDir scratch;
  std::vector<PredictedSample> samples(3);
  samples[0] = {manifests::Reason::none, "", 640, 480, true, numbered(0)};
  samples[1] = {manifests::Reason::image_truncated, "ends at byte 17", 0, 0, false, {}};
  samples[2] = {manifests::Reason::none, "", 1, 2, false, numbered(1000)};
  std::vector<candidates::Candidate> candidates(3);
  candidates[2].record.id = "set/train/a.png#2";
  candidates[2].record.image_ref = "a.png";
  candidates[2].record.box = {1.5, 2.5, 3.5, 4.5};
  candidates[2].record.keypoints[25] = {7.25, 8.25, 2.0F, 0.5F};
  manifests::write_table(scratch.path() / "t.h5", to_table(candidates, samples));
  const manifests::Table table = manifests::read_table(scratch.path() / "t.h5");
  const manifests::SampleRecord asked = candidate_from_table(table, 2);
  EXPECT_EQ(asked.id, "set/train/a.png#2");
  EXPECT_EQ(asked.image_ref, "a.png");
  EXPECT_EQ(asked.box.w_px, 3.5);
  EXPECT_EQ(asked.keypoints[25].y_px, 8.25);
  EXPECT_EQ(asked.keypoints[25].v, 2.0F);
  EXPECT_EQ(asked.keypoints[25].weight, 0.5F);
  EXPECT_EQ(asked.keypoints[24].weight, 0.0F);
  const auto back = predicted_from_table(table);
  ASSERT_EQ(back.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(back[i].failure, samples[i].failure);
    EXPECT_EQ(back[i].detail, samples[i].detail);
    EXPECT_EQ(back[i].image_width_px, samples[i].image_width_px);
    EXPECT_EQ(back[i].image_height_px, samples[i].image_height_px);
    EXPECT_EQ(back[i].has_mask, samples[i].has_mask);
    expect_equal(back[i].body, samples[i].body);
  }
}

TEST(UnitTables, RefinementsSurviveTheDiskWithCurvesOfDifferentLengths) {
  const testing::ScratchDir scratch;
  std::vector<RefinedSample> samples = {
      {4, {0.5, 0.25, 0.125}, numbered(3), {0.6, 0.7, 0.8}}, {9, {0.7}, numbered(7), {}}, {11, {}, {}, {}}};
  manifests::write_table(scratch.path() / "t.h5", to_table(samples));
  const auto back = refined_from_table(manifests::read_table(scratch.path() / "t.h5"));
  ASSERT_EQ(back.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(back[i].sample, samples[i].sample);
    EXPECT_EQ(back[i].curve, samples[i].curve);
    EXPECT_EQ(back[i].held_out_curve, samples[i].held_out_curve);
    expect_equal(back[i].body, samples[i].body);
  }
}

TEST(UnitTables, WithoutHeldOutKeypointsThereIsNoColumnOfThem) {
  const std::vector<RefinedSample> samples{{4, {0.5, 0.25}, numbered(3), {}}};
  const manifests::Table table = to_table(samples);
  EXPECT_EQ(table.blobs.count("held_out_curve"), 0U);
  EXPECT_TRUE(refined_from_table(table)[0].held_out_curve.empty());
}

TEST(UnitTables, MeasuresSurviveTheDisk) {
  const testing::ScratchDir scratch;
  std::vector<MeasuredLabel> labels(2);
  labels[0].sample = 3;
  double number = 1.0;
  for (const manifests::TrustColumn& column : manifests::kTrustColumns)
    labels[0].scores.*column.score = number *= 1.5;
  labels[1].sample = 8;
  labels[1].scores.visible = 5;  // nothing else could be measured
  manifests::write_table(scratch.path() / "t.h5", to_table(labels));
  const auto back = measured_from_table(manifests::read_table(scratch.path() / "t.h5"));
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].sample, 3U);
  EXPECT_TRUE(std::isnan(back[0].scores.combined)) << "it is computed anew";
  number = 1.5;
  for (const manifests::TrustColumn& column : std::span(manifests::kTrustColumns).subspan(1)) {
    EXPECT_EQ(back[0].scores.*column.score, number *= 1.5) << column.name;
  }
  EXPECT_EQ(back[1].sample, 8U);
  EXPECT_EQ(back[1].scores.visible, 5);
  EXPECT_TRUE(std::isnan(back[1].scores.pose_prior));
  EXPECT_TRUE(std::isnan(back[1].scores.mask));
  manifests::write_table(scratch.path() / "empty.h5", to_table(std::vector<MeasuredLabel>()));
  EXPECT_TRUE(measured_from_table(manifests::read_table(scratch.path() / "empty.h5")).empty());
}

TEST(UnitTables, AnEmptyUnitIsATable) {
  const testing::ScratchDir scratch;
  manifests::write_table(scratch.path() / "t.h5", to_table(std::vector<RefinedSample>()));
  EXPECT_TRUE(refined_from_table(manifests::read_table(scratch.path() / "t.h5")).empty());
}

TEST(UnitTables, AMissingColumnIsNamed) {
  manifests::Table table = to_table(std::vector<candidates::Candidate>(1), std::vector<PredictedSample>(1));
  table.numeric.erase("betas");
  try {
    predicted_from_table(table);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("betas"), std::string::npos) << error.what();
  }
}

TEST(UnitTables, CropsSurviveTheDisk) {
  const testing::ScratchDir scratch;
  std::vector<EncodedCrop> crops(3);
  crops[0] = {2, {std::byte{1}, std::byte{2}}, {std::byte{3}}, 480, {1, 2, 3, 4, 5, 6}};
  crops[1] = {5, {std::byte{7}}, {}, 300, {6, 5, 4, 3, 2, 1}};
  crops[2] = {6, {}, {}, 256, {}};  // of shards that refer to pictures
  manifests::write_table(scratch.path() / "t.h5", to_table(crops));
  const auto back = crops_from_table(manifests::read_table(scratch.path() / "t.h5"));
  ASSERT_EQ(back.size(), crops.size());
  for (std::size_t i = 0; i < crops.size(); ++i) {
    EXPECT_EQ(back[i].sample, crops[i].sample);
    EXPECT_EQ(back[i].picture, crops[i].picture);
    EXPECT_EQ(back[i].mask, crops[i].mask);
    EXPECT_EQ(back[i].side_px, crops[i].side_px);
    EXPECT_EQ(back[i].from_image, crops[i].from_image);
  }
  std::swap(crops[0].sample, crops[1].sample);
  manifests::write_table(scratch.path() / "t.h5", to_table(crops));
  EXPECT_THROW(crops_from_table(manifests::read_table(scratch.path() / "t.h5")), std::runtime_error);
}

// A stranger's table is read too: `explain` and `overlay` take the stages of any output folder.
TEST(UnitTables, AColumnOfAnotherShapeIsRefused) {
  const manifests::Table predicted =
      to_table(std::vector<candidates::Candidate>(3), std::vector<PredictedSample>(3));
  std::vector<EncodedCrop> encoded(3);
  for (std::size_t i = 0; i < encoded.size(); ++i) encoded[i].sample = i;
  const manifests::Table crops = to_table(encoded);
  const auto refused = [](manifests::Table table, const std::string& column, const auto& read) {
    table.numeric.at(column).row_shape = {};
    auto& data = table.numeric.at(column).data;
    data.resize(data.size() / 13);  // not of three rows, whatever a row has
    EXPECT_THROW(read(table), std::runtime_error) << column;
  };
  for (const char* column : {"image_size_px", "has_mask", "rotations", "camera"}) {
    refused(predicted, column, [](const auto& table) { return predicted_from_table(table); });
  }
  for (const char* column : {"box_xywh_px", "keypoints_px", "keypoint_v", "keypoint_weight"}) {
    refused(predicted, column, [](const auto& table) { return candidate_from_table(table, 2); });
  }
  manifests::Table whole = crops;
  for (const auto& [name, views] : crops.blob_views) {
    for (const auto view : views) whole.blobs[name].emplace_back(view.begin(), view.end());
  }
  for (const char* column : {"sample", "side_px", "from_image"}) {
    refused(whole, column, [](const auto& table) { return crops_from_table(table); });
  }
}

TEST(UnitTables, ACurveOfHalfANumberIsRefused) {
  RefinedSample sample;
  sample.curve = {0.5, 0.25};
  manifests::Table table = to_table(std::vector<RefinedSample>{sample});
  table.blobs.at("curve").front().resize(15);
  EXPECT_THROW(refined_from_table(table), std::runtime_error);
}

TEST(UnitTables, AReasonThatIsNoneIsRefused) {
  manifests::Table table = to_table(std::vector<candidates::Candidate>(1), std::vector<PredictedSample>(1));
  table.text.at("failure").front() = "no_such_reason";
  EXPECT_THROW(predicted_from_table(table), std::runtime_error);
}

}  // namespace
}  // namespace q3d::pipeline::unit
