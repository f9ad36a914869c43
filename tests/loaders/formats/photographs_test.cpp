// Photographs without keypoints: a folder, boxes in COCO's form, and MegaDetector's output.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Reason;
using manifests::SampleRecord;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// The folder's own pictures are 64 x 48 px.
struct Photographs {
  Photographs() {
    options = folder.options("photographs");
    options.min_confidence = 0.2;
  }
  Dataset load(const json& document) {
    write_text(folder.root() / "train.json", document.dump());
    options.annotations = "train.json";
    return load_dataset(options);
  }
  Folder folder;
  DatasetOptions options;
};

json megadetector(const json& detections) {
  return {{"detection_categories", {{"1", "animal"}, {"2", "person"}, {"3", "vehicle"}}},
          {"images", {{{"file", "images/horse_11361_0.png"}, {"detections", detections}}}}};
}

void expect_box(const SampleRecord& sample, double x, double y, double w, double h) {
  EXPECT_EQ(sample.failure, Reason::none) << sample.failure_detail;
  EXPECT_NEAR(sample.box.x_px, x, 1e-9);
  EXPECT_NEAR(sample.box.y_px, y, 1e-9);
  EXPECT_NEAR(sample.box.w_px, w, 1e-9);
  EXPECT_NEAR(sample.box.h_px, h, 1e-9);
}

TEST(Photographs, APictureOfAFolderIsOneAnimalThatFillsIt) {
  Photographs photographs;
  photographs.options.annotations = ".";
  const Dataset dataset = load_dataset(photographs.options);
  ASSERT_FALSE(dataset.records.empty());
  for (const SampleRecord& sample : dataset.records)
    expect_box(sample, 0, 0, sample.width_px, sample.height_px);
  EXPECT_TRUE(std::is_sorted(dataset.records.begin(), dataset.records.end(),
                             [](const auto& a, const auto& b) { return a.image_ref < b.image_ref; }));
  ASSERT_EQ(dataset.notes.size(), 1U);
  EXPECT_THAT(dataset.notes[0].text, HasSubstr("one animal that fills it"));
}

TEST(Photographs, AFolderWithoutPicturesIsAnError) {
  Photographs photographs;
  std::filesystem::create_directories(photographs.folder.root() / "empty");
  photographs.options.annotations = "empty";
  EXPECT_THROW(load_dataset(photographs.options), std::runtime_error);
}

TEST(Photographs, MegadetectorsBoxesAreSharesOfThePicture) {
  Photographs photographs;
  const Dataset dataset =
      photographs.load(megadetector({{{"category", "1"}, {"conf", 0.9}, {"bbox", {0.25, 0.5, 0.5, 0.25}}}}));
  ASSERT_EQ(dataset.records.size(), 1U);
  expect_box(dataset.records[0], 16, 24, 32, 12);
  EXPECT_EQ(dataset.records[0].id, "set/train/images/horse_11361_0.png#0");
}

TEST(Photographs, PeopleAndUnsureBoxesAreLeftOutAndCounted) {
  Photographs photographs;
  const Dataset dataset =
      photographs.load(megadetector({{{"category", "2"}, {"conf", 0.9}, {"bbox", {0.1, 0.1, 0.5, 0.5}}},
                                     {{"category", "1"}, {"conf", 0.1}, {"bbox", {0.1, 0.1, 0.5, 0.5}}},
                                     {{"category", "1"}, {"conf", 0.3}, {"bbox", {0.1, 0.1, 0.5, 0.5}}}}));
  ASSERT_EQ(dataset.records.size(), 1U);
  EXPECT_EQ(dataset.records[0].id, "set/train/images/horse_11361_0.png#2");
  ASSERT_EQ(dataset.notes.size(), 2U);
  EXPECT_THAT(dataset.notes[0].text, HasSubstr("below min_confidence (0.2)"));
  EXPECT_THAT(dataset.notes[1].text, HasSubstr("people and vehicles"));
}

TEST(Photographs, PixelsInAMegadetectorFileFail) {
  Photographs photographs;
  const Dataset dataset =
      photographs.load(megadetector({{{"category", "1"}, {"conf", 0.9}, {"bbox", {16, 24, 32, 12}}}}));
  ASSERT_EQ(dataset.records.size(), 1U);
  EXPECT_EQ(dataset.records[0].failure, Reason::record_malformed);
  EXPECT_THAT(dataset.records[0].failure_detail, HasSubstr("shares of the picture"));
}

TEST(Photographs, BoxesOfACocoFile) {
  Photographs photographs;
  const Dataset dataset =
      photographs.load({{"images", {{{"id", "a"}, {"file_name", "images/horse_11361_0.png"}}}},
                        {"annotations",
                         {{{"image_id", "a"}, {"bbox", {8, 9, 30, 20}}, {"score", 0.8}},
                          {{"image_id", "a"}, {"bbox", {8, 9, 30, 20}}, {"score", 0.1}},
                          {{"image_id", "b"}, {"bbox", {8, 9, 30, 20}}}}}});
  ASSERT_EQ(dataset.records.size(), 2U);
  expect_box(dataset.records[0], 8, 9, 30, 20);
  EXPECT_EQ(dataset.records[1].failure, Reason::image_not_listed);
}

TEST(Photographs, HaveNoKeypoints) {
  Photographs photographs;
  photographs.options.annotations = ".";
  for (const SampleRecord& sample : load_dataset(photographs.options).records) {
    for (const manifests::Keypoint& keypoint : sample.keypoints) EXPECT_EQ(keypoint.weight, 0.0F);
  }
}

}  // namespace
}  // namespace q3d::loaders::formats
