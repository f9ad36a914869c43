// StanfordExtra's records: a list of dogs with 24 joints, or the first 20.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Family;
using manifests::Reason;

constexpr std::size_t kLeftFrontPaw = 3;
constexpr std::size_t kLeftBackThigh = 10;
constexpr std::size_t kNose = 24;
constexpr const char* kPicture = "n02000001-Hound/n02000001_7.png";

// Joint i lies at (10 + i, 20 + i).
json dog(std::size_t joints) {
  json rows = json::array();
  for (std::size_t i = 0; i < joints; ++i)
    rows.push_back({10.0 + static_cast<double>(i), 20.0 + static_cast<double>(i), 1.0});
  return {
      {"img_path", kPicture}, {"img_width", 64},           {"img_height", 48}, {"img_bbox", {5, 6, 50, 40}},
      {"joints", rows},       {"is_multiple_dogs", false}, {"seg", "abc"}};
}

struct Folder {
  Folder() { write_picture(scratch.path() / "Images" / kPicture); }
  Dataset load(const json& document) const {
    write_text(scratch.path() / "dogs.json", document.dump());
    return load_dataset({.name = "dogs",
                         .format = "stanfordextra",
                         .root = scratch.path(),
                         .annotations = "dogs.json",
                         .images = {}});
  }
  q3d::testing::ScratchDir scratch;
};

TEST(StanfordExtra, reads_24_joints_by_the_published_order) {
  const Folder folder;
  json hidden = dog(24);
  hidden["joints"][16] = {313.0, 70.0, 0.0};  // the nose: a position, but not visible
  const Dataset dataset = folder.load({dog(24), hidden});
  ASSERT_EQ(dataset.records.size(), 2U);
  const manifests::SampleRecord& sample = dataset.records[0];
  ASSERT_EQ(sample.failure, Reason::none) << sample.failure_detail;
  EXPECT_EQ(sample.keypoints[kLeftFrontPaw].x_px, 10.0);   // joint 0
  EXPECT_EQ(sample.keypoints[kLeftBackThigh].x_px, 15.0);  // joint 5, the left rear top
  EXPECT_EQ(sample.keypoints[kNose].y_px, 36.0);           // joint 16
  EXPECT_EQ(sample.box.w_px, 50.0);
  EXPECT_EQ(sample.width_px, 64);
  EXPECT_EQ(sample.species, "dog");
  EXPECT_EQ(sample.family, Family::canidae);
  EXPECT_EQ(dataset.records[1].keypoints[kNose].weight, 0.0F);
}

TEST(StanfordExtra, the_first_release_lacks_the_last_four) {
  const Folder folder;
  const Dataset dataset = folder.load(json::array({dog(20)}));
  ASSERT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].keypoints[kNose].weight, 1.0F);
  EXPECT_EQ(dataset.records[0].keypoints[0].weight, 0.0F);  // left_eye is joint 20
}

TEST(StanfordExtra, a_bad_record_fails_alone_and_another_file_is_refused) {
  const Folder folder;
  json no_area = dog(24);
  no_area["img_bbox"] = {5, 6, 0, 40};
  const Dataset dataset = folder.load({dog(23), no_area, dog(24)});
  EXPECT_EQ(dataset.records[0].failure, Reason::keypoints_wrong_length);
  EXPECT_EQ(dataset.records[1].failure, Reason::box_zero_size);
  EXPECT_EQ(dataset.records[2].failure, Reason::none);
  EXPECT_THROW(folder.load(json::object()), std::runtime_error);
}

// Joints lie on the diagonal from (10, 20) to (33, 43), and a box has a margin of a tenth of its longer side.
TEST(StanfordExtra, a_box_that_nobody_drew_is_made) {
  const Folder folder;
  for (const json& box :
       {json(), json(json::array()), json({0, 0, 0, 0}), json({-1, -1, -1, -1}), json("")}) {
    json record = dog(24);
    record["img_bbox"] = box;
    const manifests::SampleRecord sample = folder.load(json::array({record})).records[0];
    ASSERT_EQ(sample.failure, Reason::none) << box << sample.failure_detail;
    EXPECT_NEAR(sample.box.x_px, 10.0 - 2.3, 1e-9) << box;
    EXPECT_NEAR(sample.box.h_px, 23.0 + 4.6, 1e-9) << box;
  }
}

}  // namespace
}  // namespace q3d::loaders::formats
