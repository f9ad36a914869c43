// BADJA's joint annotations: a file for each video, joints as (row, column).
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
constexpr std::size_t kRightFrontPaw = 4;
constexpr std::size_t kTailTip = 19;

// Joint i lies in row 5 + i and column 10 + i; even joints are visible.
json frame(const std::string& picture) {
  json joints = json::array();
  json visible = json::array();
  for (int i = 0; i < 37; ++i) {
    joints.push_back({5 + i, 10 + i});
    visible.push_back(i % 2 == 0);
  }
  return {{"image_path", picture},
          {"segmentation_path", "masks/0.png"},
          {"joints", joints},
          {"visibility", visible}};
}

struct Folder {
  Folder() {
    write_picture(scratch.path() / "rgb/0000.png");
    write_text(scratch.path() / "joint_annotations/cows.json", json::array({frame("rgb/0000.png")}).dump());
  }
  Dataset load(const std::string& annotations) const {
    return load_dataset({.name = "badja",
                         .format = "badja",
                         .root = scratch.path(),
                         .annotations = annotations,
                         .images = {}});
  }
  q3d::testing::ScratchDir scratch;
};

TEST(Badja, joints_are_row_and_column_and_sides_are_those_of_the_catalogue) {
  const Folder folder;
  const Dataset dataset = folder.load("joint_annotations/cows.json");
  ASSERT_EQ(dataset.records.size(), 1U);
  const manifests::SampleRecord& sample = dataset.records[0];
  ASSERT_EQ(sample.failure, Reason::none) << sample.failure_detail;
  EXPECT_EQ(sample.keypoints[kLeftFrontPaw].x_px, 24.0);  // upper_left_3 is joint 14
  EXPECT_EQ(sample.keypoints[kLeftFrontPaw].y_px, 19.0);
  EXPECT_EQ(sample.keypoints[kRightFrontPaw].x_px, 20.0);  // upper_right_3 is joint 10
  EXPECT_EQ(sample.keypoints[kTailTip].weight, 0.0F);      // tail_6 is joint 31, which is not visible
  EXPECT_EQ(sample.species, "cow");
  EXPECT_EQ(sample.family, Family::bovidae);
  // The box is around the visible joints 0 to 36, with a margin of a tenth of 36 px.
  EXPECT_NEAR(sample.box.x_px, 10.0 - 3.6, 1e-9);
  EXPECT_NEAR(sample.box.w_px, 36.0 + 7.2, 1e-9);
}

TEST(Badja, a_folder_has_a_file_for_each_video) {
  const Folder folder;
  write_text(folder.scratch.path() / "joint_annotations/horsejump-high.json",
             json::array({frame("rgb/0000.png"), frame("rgb/none.png")}).dump());
  const Dataset dataset = folder.load("joint_annotations");
  ASSERT_EQ(dataset.records.size(), 3U);
  EXPECT_EQ(dataset.records[1].species, "horse");
  EXPECT_EQ(dataset.records[2].failure, Reason::image_missing);
  EXPECT_NE(dataset.records[0].id, dataset.records[1].id);
  EXPECT_EQ(dataset.files.size(), 2U);
}

TEST(Badja, wrong_lengths_fail_the_record) {
  const Folder folder;
  json few = frame("rgb/0000.png");
  few["visibility"].erase(0);
  json none = frame("rgb/0000.png");
  none.erase("visibility");
  json words = frame("rgb/0000.png");
  words["visibility"][3] = "yes";
  write_text(folder.scratch.path() / "bad.json", json::array({few, none, words}).dump());
  const Dataset dataset = folder.load("bad.json");
  EXPECT_EQ(dataset.records[0].failure, Reason::keypoints_wrong_length);
  EXPECT_EQ(dataset.records[1].failure, Reason::keypoints_missing);
  EXPECT_EQ(dataset.records[2].failure, Reason::keypoints_wrong_length);
  write_text(folder.scratch.path() / "object.json", "{}");
  EXPECT_THROW(folder.load("object.json"), std::runtime_error);
}

}  // namespace
}  // namespace q3d::loaders::formats
