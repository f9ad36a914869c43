// Datasets as a build takes them in: compared with their pictures, corrected, and without this machine's
// paths.
#include "pipeline/candidates/ingest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/candidates/local_folders.h"
#include "tests/loaders/formats/annotation_files.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::candidates {
namespace {

namespace fs = std::filesystem;
using loaders::formats::testing_files::prima_record;
using loaders::formats::testing_files::write_picture;
using loaders::formats::testing_files::write_text;
using manifests::Reason;
using manifests::SampleRecord;
using nlohmann::json;
using ::testing::HasSubstr;

constexpr const char* kPicture = "images/a.png";
constexpr const char* kId = "lab/train/images/a.png#0";

class IngestTest : public ::testing::Test {
 protected:
  fs::path folder() const { return scratch_.path(); }
  fs::path root() const { return folder() / "data"; }

  static void write_records(const fs::path& place, const std::vector<json>& records) {
    write_text(place / "train.json", json{{"data", records}}.dump());
  }

  // Takes in the dataset in a folder; `keys` are further ones of the dataset.
  Ingest taken(const fs::path& place, const json& keys = json::object(),
               const fs::path& corrections = {}) const {
    json dataset{{"name", "lab"},
                 {"format", "prima"},
                 {"root", place.string()},
                 {"annotations", "train.json"},
                 {"role", "2d_only"}};
    dataset.update(keys);
    json whole{{"name", "tiny"}};
    whole["datasets"] = json::array({dataset});
    config::BuildConfig config = config::parse_build_config(whole, "test");
    config.corrections = corrections;
    manifests::DigestCache digests(folder() / "digests.txt");
    return ingest(config, digests, {}, folder());
  }

 private:
  testing::ScratchDir scratch_;
};

// A record with a box, of whose keypoints none is labelled. It states a picture of 64 x 48 px.
json unlabelled() {
  json record = prima_record(kPicture);
  record.erase("mask_path");
  for (json& row : record["keypoint_2d"]) row[2] = 0.0;
  return record;
}

class Corrected : public IngestTest {
 protected:
  // The record without a labelled keypoint, after the first five were set along a line from (x, x).
  SampleRecord corrected(double x_px, double step_px, const json& keys = json::object()) const {
    write_records(root(), {unlabelled()});
    std::vector<CorrectedPoint> points;
    for (std::size_t i = 0; i < 5; ++i) {
      const double place_px = x_px + step_px * static_cast<double>(i);
      points.push_back({i, place_px, place_px, 2});
    }
    const fs::path file = folder() / "corrections.tsv";
    write_text(file, corrections_text({{kId, points}}));
    return taken(root(), keys, file).candidates.at(0).record;
  }
};

TEST_F(Corrected, ARecordWithoutLabelledKeypointsIsSoundAgain) {
  write_picture(root() / kPicture);
  const SampleRecord record = corrected(10.0, 4.0);
  EXPECT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.keypoints[4].x_px, 26.0);
  EXPECT_EQ(record.scale, 1.0);
}

TEST_F(Corrected, ItsBoxIsScaledWithThePicture) {
  write_picture(root() / kPicture, 32, 24);
  const SampleRecord record = corrected(5.0, 2.0, {{"resized", "scale"}});
  EXPECT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.scale, 0.5);
  EXPECT_EQ(record.box.w_px, 18.0);
  EXPECT_EQ(record.width_px, 32);
  EXPECT_EQ(record.keypoints[0].x_px, 5.0) << "corrections are pixels of the picture";
}

TEST_F(Corrected, APictureOfAnotherSizeIsRefused) {
  write_picture(root() / kPicture, 32, 24);
  const SampleRecord record = corrected(5.0, 2.0);
  EXPECT_EQ(record.failure, Reason::size_mismatch);
  EXPECT_THAT(record.failure_detail, HasSubstr("64 x 48 px in the annotation file and 32 x 24 px"));
}

TEST_F(Corrected, APictureThatIsTooLargeIsRefused) {
  write_picture(root() / kPicture);
  EXPECT_EQ(corrected(10.0, 4.0, {{"max_picture_megapixels", 0.003}}).failure, Reason::image_too_large);
}

TEST_F(Corrected, FractionsAreNoPixels) {
  write_picture(root() / kPicture);
  const SampleRecord record = corrected(0.1, 0.15);
  EXPECT_EQ(record.failure, Reason::not_in_pixels);
  EXPECT_THAT(record.failure_detail, HasSubstr("after the corrections: keypoints: all 5 visible ones"));
}

TEST_F(Corrected, PointsBesideThePictureAreRefused) {
  write_picture(root() / kPicture);
  EXPECT_EQ(corrected(200.0, 4.0).failure, Reason::keypoints_outside);
}

// A record that nobody corrected keeps the reason of its labels, whatever its picture is.
TEST_F(Corrected, WithoutCorrectionsTheReasonStays) {
  write_picture(root() / kPicture);
  json record = unlabelled();
  record["bbox"] = {0.1, 0.1, 0.5, 0.5};
  write_records(root(), {record});
  EXPECT_EQ(taken(root()).candidates.at(0).record.failure, Reason::no_visible_keypoints);
}

TEST(ApplyCorrections, ARecordWithoutABoxIsRefused) {
  std::vector<SampleRecord> records(1);
  records[0].id = kId;
  records[0].failure = Reason::no_visible_keypoints;
  Corrections corrections;
  corrections.points[kId].push_back({0, 10.0, 12.0, 2});
  apply_corrections(corrections, records);
  EXPECT_EQ(records[0].failure, Reason::box_missing);
  EXPECT_THAT(records[0].failure_detail, HasSubstr("got no box in the annotation file"));
}

class Moved : public IngestTest {
 protected:
  // Records of a missing picture, of a link to nothing, and one whose box has three numbers.
  static void write_bad_records(const fs::path& place) {
    json no_box = prima_record(kPicture);
    no_box["bbox"] = {1, 2, 3};
    write_picture(place / kPicture);
    fs::create_symlink("nothing.png", place / "images/link.png");
    write_records(place, {prima_record("images/gone.png"), prima_record("images/link.png"), no_box});
  }
  // All details and notes, one a line.
  std::string said(const fs::path& place, const json& keys = json::object()) const {
    const Ingest found = taken(place, keys);
    std::string text;
    found.candidates.for_each(
        [&](std::size_t, const Candidate& candidate) { text += candidate.record.failure_detail + "\n"; });
    for (const IngestNote& note : found.notes) text += note.text + "\n";
    return text;
  }
};

TEST_F(Moved, WhatIsSaidNamesNoFolderOfThisMachine) {
  write_bad_records(root());
  write_bad_records(folder() / "further/down");
  const std::string expected = said(root());
  EXPECT_THAT(expected, HasSubstr("train.json: data[0].img_path: got images/gone.png, which is not below the "
                                  "root, expected a picture below the dataset's root"));
  EXPECT_THAT(expected, HasSubstr("train.json: data[2].bbox: got "));
  EXPECT_THAT(expected, ::testing::Not(HasSubstr(folder().string())));
  EXPECT_EQ(said(folder() / "further/down"), expected);
}

TEST_F(Moved, ARootBehindALinkIsNotNamed) {
  write_bad_records(root());
  fs::create_directory_symlink(root(), folder() / "link");
  EXPECT_EQ(said(folder() / "link"), said(root()));
  EXPECT_THAT(said(folder() / "link"), ::testing::Not(HasSubstr(folder().string())));
}

TEST_F(Moved, PicturesAndAnnotationsOutsideTheRootAreNotNamed) {
  write_bad_records(root());
  write_bad_records(folder() / "labels");
  const std::string text = said(root(), {{"images", (folder() / "labels").string()},
                                         {"annotations", (folder() / "labels/train.json").string()}});
  EXPECT_THAT(text,
              HasSubstr("train.json: data[0].img_path: got images/gone.png, which is not below the folder "
                        "of pictures"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr(folder().string())));
}

TEST_F(Moved, TheUnitsKeepTheirDigests) {
  write_bad_records(root());
  write_bad_records(folder() / "further/down");
  EXPECT_EQ(taken(root()).units.at(0).input_digest,
            taken(folder() / "further/down").units.at(0).input_digest);
}

// A version has the details of its failures in verdicts.csv.
TEST_F(IngestTest, AnotherDetailOfAFailureIsAnotherInput) {
  write_records(root(), {prima_record(kPicture)});
  const auto taken_with = [&](int width_px) {
    write_picture(root() / kPicture, width_px, 48);
    return taken(root());
  };
  const Ingest wide = taken_with(70);
  const Ingest wider = taken_with(80);
  EXPECT_EQ(wide.candidates.at(0).record.failure, Reason::size_mismatch);
  EXPECT_EQ(wider.candidates.at(0).record.failure, Reason::size_mismatch);
  EXPECT_NE(wide.units.at(0).input_digest, wider.units.at(0).input_digest);
  EXPECT_EQ(wide.units.at(0).input_digest, taken_with(70).units.at(0).input_digest);
}

TEST_F(Moved, ARootWhoseNameIsNoUtf8IsNotNamed) {
  write_bad_records(root());
  const fs::path latin = folder() / "caf\xe9";
  write_bad_records(latin);
  EXPECT_EQ(said(latin), said(root()));
}

TEST(LocalFoldersTest, AFolderIsAPathOfItsOwn) {
  const testing::ScratchDir scratch;
  fs::create_directories(scratch.path() / "dogs");
  loaders::formats::DatasetOptions options;
  options.root = scratch.path() / "dogs/";
  const LocalFolders folders(options);
  const std::string root = (scratch.path() / "dogs").string();
  EXPECT_EQ(folders.without(root + "/a.json: got \"" + root + "/b.png\""), "a.json: got \"b.png\"");
  EXPECT_EQ(folders.without("a folder " + root + ", and " + root + "/"), "a folder the root, and the root");
  for (const std::string& other : {root + "2/a.png", "/mnt" + root + "/a.png", "file://" + root + "/a.png"}) {
    EXPECT_EQ(folders.without("got " + other), "got " + other);
  }
}

}  // namespace
}  // namespace q3d::pipeline::candidates
