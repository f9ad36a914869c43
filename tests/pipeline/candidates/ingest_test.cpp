// Datasets as a build takes them in: compared with their pictures, corrected, and without this machine's
// paths.
#include "pipeline/candidates/ingest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

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

// What the file's labels are is no matter for a record that nobody corrected.
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

}  // namespace
}  // namespace q3d::pipeline::candidates
