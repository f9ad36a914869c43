// Exports, read back by this program's own loaders.
#include "pipeline/exports/export_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "filters/metrics.h"
#include "loaders/formats/dataset.h"
#include "loaders/pictures/image.h"
#include "manifests/atomic_file.h"
#include "pipeline/dataset/export_list.h"
#include "pipeline/exports/corrections.h"
#include "pipeline/exports/picture.h"
#include "pipeline/run/errors.h"
#include "pipeline/unit/annotated_body.h"
#include "pipeline/unit/crop_keypoints.h"
#include "tests/pipeline/exports/body_dataset.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::exports {
namespace {

namespace fs = std::filesystem;
using manifests::ShardSample;
using nlohmann::json;
using ::testing::HasSubstr;

// A dataset of two shards with samples whose stored crops are whole and reduced in turn.
class Exports : public ::testing::Test {
 protected:
  Exports() : made_(testing::make_body_dataset(scratch_.path(), "made", {"a", "b"}, 1)) {}

  ExportSummary run(Format format, const std::string& out, bool pictures_anyway = false, int threads = 0) {
    return export_dataset(made_.folder, {format, scratch_.path() / out, pictures_anyway, threads, true});
  }

  // An export that fails after all pictures and parts are written: a folder has the name of its last file.
  void stop_before_the_last_file(const std::string& out) {
    const fs::path folder = scratch_.path() / out;
    fs::create_directories(folder / ".parts");
    fs::create_directory(folder / "croissant.json");
    EXPECT_THROW(run(Format::coco, out), std::runtime_error);
    fs::remove(folder / "croissant.json");
  }

  std::map<std::string, std::string> files(const std::string& out) const {
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(scratch_.path() / out)) {
      if (!entry.is_regular_file()) continue;
      contents[fs::relative(entry.path(), scratch_.path() / out).string()] =
          manifests::read_file(entry.path());
    }
    return contents;
  }

  testing::ScratchDir scratch_;
  testing::BodyDataset made_;
  const std::vector<ShardSample>& samples_ = made_.samples;
};

TEST_F(Exports, PartsThatAKilledRunHasLeftBesideACompleteExportGo) {
  run(Format::coco, "coco");
  const std::filesystem::path parts = scratch_.path() / "coco/.parts";
  EXPECT_FALSE(std::filesystem::exists(parts));
  std::filesystem::create_directory(parts);
  run(Format::coco, "coco");
  EXPECT_FALSE(std::filesystem::exists(parts));
}

TEST_F(Exports, PrimaIsLoadedAgainWithEqualErrors) {
  const ExportSummary summary = run(Format::prima, "prima");
  EXPECT_EQ(summary.samples, 8);
  EXPECT_EQ(summary.pictures, 8);
  loaders::formats::DatasetOptions options;
  options.name = "again";
  options.format = "prima";
  options.root = scratch_.path() / "prima/zoo";
  options.annotations = "train.json";
  const auto loaded = loaders::formats::load_dataset(options);
  ASSERT_EQ(loaded.records.size(), samples_.size());
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const manifests::SampleRecord& record = loaded.records[i];
    const ShardSample& sample = samples_[i];
    ASSERT_EQ(record.failure, manifests::Reason::none) << record.failure_detail;
    ASSERT_TRUE(record.truth.has_value());
    EXPECT_EQ(record.species, sample.record.species);
    EXPECT_EQ(record.family, sample.record.family);
    EXPECT_EQ(record.truth->betas, sample.body.betas);
    EXPECT_EQ(record.truth->keypoints_3d, sample.keypoints_3d);
    EXPECT_EQ(record.mask_path.empty(), false);
    const auto body = unit::annotated_body(*record.truth);
    for (std::size_t n = 0; n < sample.body.pose.size(); ++n) {
      EXPECT_NEAR(body.pose[n], sample.body.pose[n], 1e-6);
    }
    const auto error = filters::projection_error(body.keypoints_2d, unit::crop_keypoints(record));
    ASSERT_TRUE(error.has_value());
    EXPECT_NEAR(*error, sample.judgement.final_error, 1e-6) << record.id;
  }
}

// The keypoints lie on the same pixels: what a red channel that rises with x says about a keypoint's place
// in the source is what it says in the exported picture.
TEST_F(Exports, ThePictureShiftsWithItsNumbers) {
  int shifted = 0;
  for (const ShardSample& sample : samples_) {
    const ExportedPicture stored =
        export_picture(sample, manifests::ImageEncoding::jpeg, Pictures::as_stored);
    const ExportedPicture official =
        export_picture(sample, manifests::ImageEncoding::jpeg, Pictures::official);
    EXPECT_EQ(stored.bytes, sample.crop);
    if (sample.crop_from_image[0] == 1.0) {
      EXPECT_EQ(official.bytes, sample.crop);
      continue;
    }
    ++shifted;
    const double shift = official.from_image[2] - stored.from_image[2];
    EXPECT_GT(std::abs(shift), 0.0);
    EXPECT_LE(std::abs(shift), 0.5);
    const cv::Mat before = loaders::pictures::decode_image(stored.bytes).rgb;
    const cv::Mat after = loaders::pictures::decode_image(official.bytes).rgb;
    const int middle = before.rows / 2;  // the picture's red channel is 255 x / 320 there
    const double slope =
        (before.at<cv::Vec3b>(middle, middle + 60)[0] - before.at<cv::Vec3b>(middle, middle - 60)[0]) / 120.0;
    double change = 0.0;
    for (int x = middle - 60; x < middle + 60; ++x) {
      change += after.at<cv::Vec3b>(middle, x)[0] - before.at<cv::Vec3b>(middle, x)[0];
    }
    EXPECT_NEAR(change / 120.0, -slope * shift, 0.25);  // JPEG's noise
  }
  EXPECT_GT(shifted, 0);
}

TEST_F(Exports, EqualBytesForAnyThreadsAndAfterAnInterruption) {
  run(Format::prima, "one", false, 1);
  run(Format::prima, "four", false, 4);
  const auto whole = files("one");
  EXPECT_EQ(files("four"), whole);
  EXPECT_EQ(whole.count("export.json"), 1U);
  // A version that lacks a shard is refused, and nothing that could be taken for an export is left.
  fs::rename(made_.folder / "shards/000001.h5", made_.folder / "away.h5");
  EXPECT_THROW(run(Format::prima, "stopped"), std::exception);
  EXPECT_FALSE(fs::exists(scratch_.path() / "stopped/export.json"));
  fs::rename(made_.folder / "away.h5", made_.folder / "shards/000001.h5");
  EXPECT_FALSE(run(Format::prima, "stopped").was_complete);
  EXPECT_EQ(files("stopped"), whole);
  EXPECT_TRUE(run(Format::prima, "stopped").was_complete);
  EXPECT_EQ(files("stopped"), whole);
}

TEST_F(Exports, OtherFoldersAndDamageAreRefused) {
  run(Format::coco, "coco");
  EXPECT_THROW(run(Format::prima, "coco"), run::ConfigError);
  EXPECT_THROW(run(Format::coco, "coco", true), run::ConfigError);
  fs::create_directories(scratch_.path() / "mine");
  std::ofstream(scratch_.path() / "mine/thesis.txt") << "years of work";
  EXPECT_THROW(run(Format::coco, "mine"), run::ConfigError);
  EXPECT_TRUE(fs::exists(scratch_.path() / "mine/thesis.txt"));
  std::ofstream(scratch_.path() / "coco/annotations.json") << "{}";
  EXPECT_THROW(run(Format::coco, "coco"), std::runtime_error);
}

// A complete export is checked as a whole, so an export with a picture that is gone or damaged is never said
// to be complete.
TEST_F(Exports, EveryFileOfACompleteExportIsListedAndChecked) {
  for (const Format format : {Format::prima, Format::coco}) {
    const std::string out = format == Format::prima ? "prima" : "coco";
    run(format, out);
    const auto whole = files(out);
    const json manifest = json::parse(whole.at("export.json"));
    std::set<std::string> listed{"export.json"};
    for (const char* list : {"files", "picture_files"}) {
      for (const json& entry : manifest.at(list)) listed.insert(entry.at("file").get<std::string>());
    }
    for (const auto& [name, content] : whole) {
      EXPECT_EQ(listed.count(name), 1U) << name;
      if (name == "export.json") continue;
      const fs::path file = scratch_.path() / out / name;
      fs::remove(file);
      EXPECT_THROW(run(format, out), std::runtime_error) << name;
      std::string damaged = content;
      damaged[damaged.size() / 2] ^= 1;
      manifests::write_file_atomically(file, damaged);
      EXPECT_THROW(run(format, out), std::runtime_error) << name;
      manifests::write_file_atomically(file, content);
    }
    EXPECT_EQ(listed.size(), whole.size());
    EXPECT_TRUE(run(format, out).was_complete);
  }
}

TEST_F(Exports, AreListedBesideTheDataset) {
  const fs::path out = made_.folder.parent_path();
  EXPECT_TRUE(dataset::listed_exports(out).empty());
  run(Format::coco, "elsewhere/coco");
  run(Format::prima, "prima", true);
  auto list = dataset::listed_exports(out);
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[0].listed.format, "coco");
  EXPECT_EQ(list[0].listed.version, made_.folder.filename());
  EXPECT_EQ(fs::weakly_canonical(out / list[0].listed.folder),
            fs::weakly_canonical(scratch_.path() / "elsewhere/coco"));
  EXPECT_TRUE(list[0].listed.folder.is_relative());
  EXPECT_EQ(list[0].state, dataset::ExportState::complete);
  EXPECT_EQ(list[0].key.size(), 64U);
  EXPECT_NE(list[0].key, list[1].key);
  EXPECT_TRUE(list[1].listed.pictures_anyway);
  const json manifest = json::parse(files("elsewhere/coco").at("export.json"));
  const std::string picture = manifest.at("picture_files")[0].at("file");
  std::ofstream(scratch_.path() / "elsewhere/coco" / picture) << "cut";
  fs::remove_all(scratch_.path() / "prima");
  list = dataset::listed_exports(out);
  EXPECT_EQ(list[0].state, dataset::ExportState::damaged);
  EXPECT_EQ(list[0].damaged, std::vector<std::string>{picture});
  EXPECT_EQ(list[1].state, dataset::ExportState::gone);
}

// An export that was killed between two units is never taken for a complete one, and goes on.
TEST_F(Exports, AStoppedExportIsListedAsUnfinished) {
  const fs::path out = made_.folder.parent_path();
  fs::create_directories(scratch_.path() / "coco/.parts");
  run(Format::coco, "whole");
  json about = json::parse(files("whole").at("export.json"));
  for (const char* key : {"samples", "pictures", "without_licence", "datasets", "files", "picture_files"}) {
    about.erase(key);
  }
  manifests::write_file_atomically(scratch_.path() / "coco/.parts/about.json", about.dump());
  dataset::list_export(dataset::PublishedDataset(made_.folder), "coco", false, scratch_.path() / "coco");
  const auto unfinished = dataset::listed_exports(out);
  ASSERT_EQ(unfinished.size(), 2U);
  EXPECT_EQ(unfinished[0].state, dataset::ExportState::unfinished);
  EXPECT_EQ(unfinished[0].key, unfinished[1].key);
  EXPECT_FALSE(run(Format::coco, "coco").was_complete);
  EXPECT_EQ(dataset::listed_exports(out)[0].state, dataset::ExportState::complete);
  EXPECT_EQ(files("coco"), files("whole"));
}

// A run that was killed before its last file has written all pictures. They are compared when it goes on.
TEST_F(Exports, PicturesThatWereLostSinceAreWrittenAgain) {
  for (const bool removes : {true, false}) {
    const std::string name = removes ? "removed" : "damaged";
    run(Format::coco, "whole");
    const auto expected = files("whole");
    const std::string picture = json::parse(expected.at("export.json")).at("picture_files")[3].at("file");
    stop_before_the_last_file(name);
    if (removes) {
      fs::remove(scratch_.path() / name / picture);
    } else {
      std::ofstream(scratch_.path() / name / picture) << "cut";
    }
    EXPECT_FALSE(run(Format::coco, name).was_complete);
    EXPECT_EQ(files(name), expected) << name;
  }
}

TEST_F(Exports, PicturesNeedAStatedLicence) {
  made_.document["datasets"]["zoo/train"]["licence"] = "";
  made_.write_document();
  const ExportSummary summary = run(Format::prima, "prima");
  EXPECT_EQ(summary.pictures, 0);
  EXPECT_EQ(summary.without_licence, std::vector<std::string>{"zoo/train"});
  for (const auto& [name, content] : files("prima")) EXPECT_THAT(name, HasSubstr(".json"));
  const json data = json::parse(files("prima").at("zoo/train.json")).at("data");
  EXPECT_EQ(data[1].at("img_path"), samples_[1].record.image_ref);
  EXPECT_EQ(data[1].at("bbox")[0], samples_[1].record.box.x_px);
  EXPECT_FALSE(data[1].contains("mask_path"));
  EXPECT_EQ(run(Format::prima, "anyway", true).pictures, 8);
}

class Corrections : public Exports {
 protected:
  Corrections() {
    run(Format::coco, "coco");
    coco_ = json::parse(files("coco").at("annotations.json"));
  }
  CocoChanges changes(const json& corrected) {
    const fs::path file = scratch_.path() / "corrected.json";
    manifests::write_file_atomically(file, corrected.dump());
    return coco_changes(scratch_.path() / "coco", file);
  }
  json coco_;
};

TEST_F(Corrections, AnUnchangedFileChangesNothing) {
  json same = coco_;
  for (json& annotation : same["annotations"]) {  // as tools that keep two decimals write it
    annotation.erase("attributes");
    for (json& number : annotation["keypoints"]) number = std::round(number.get<double>() * 100.0) / 100.0;
  }
  const CocoChanges none = changes(same);
  EXPECT_EQ(none.pictures, 8U);
  EXPECT_TRUE(none.points.empty());
  EXPECT_TRUE(none.vetoes.empty());
}

TEST_F(Corrections, MovedPointsComeBackInTheSourcePicture) {
  json moved = coco_;
  for (json& image : moved["images"]) image["id"] = image["id"].get<int>() + 500;  // tools renumber
  for (json& annotation : moved["annotations"])
    annotation["image_id"] = annotation["image_id"].get<int>() + 500;
  const auto reduced = std::find_if(samples_.begin(), samples_.end(), [](const ShardSample& sample) {
    return sample.crop_from_image[0] < 1.0;
  });
  ASSERT_NE(reduced, samples_.end());
  const ShardSample& sample = *reduced;
  const double factor = sample.crop_from_image[0];
  json& keypoints = moved["annotations"][static_cast<std::size_t>(reduced - samples_.begin())]["keypoints"];
  keypoints[0] = keypoints[0].get<double>() + 3.0 * factor;  // point 0: three source pixels to the right
  keypoints[3 * 4] = 100.0;                                  // point 4 was not labelled
  keypoints[3 * 4 + 1] = 90.0;
  keypoints[3 * 4 + 2] = 2;
  keypoints[3 * 2 + 2] = 0;  // point 2 goes
  const CocoChanges found = changes(moved);
  ASSERT_EQ(found.points.size(), 1U);
  const auto& points = found.points.at(sample.record.id);
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(points[0].keypoint, 0U);
  EXPECT_NEAR(points[0].x_px, sample.record.keypoints[0].x_px + 3.0, 1e-9);
  EXPECT_NEAR(points[0].y_px, sample.record.keypoints[0].y_px, 1e-9);
  EXPECT_EQ(points[1].keypoint, 2U);
  EXPECT_EQ(points[1].v, 0);
  EXPECT_EQ(points[2].keypoint, 4U);
  EXPECT_NEAR(points[2].x_px, (100.0 - sample.crop_from_image[2]) / factor, 1e-9);
  EXPECT_EQ(points[2].v, 2);
}

TEST_F(Corrections, RemovedAndMarkedAnnotationsAreVetoesAndUnlistedPicturesStay) {
  json changed = coco_;
  changed["annotations"].erase(2);                           // listed without an annotation
  changed["annotations"][4]["attributes"]["veto"] = "true";  // of image 5, as CVAT writes a checkbox
  changed["images"].erase(7);                                // not listed
  changed["annotations"].erase(6);
  const CocoChanges found = changes(changed);
  EXPECT_EQ(found.pictures, 7U);
  EXPECT_EQ(found.vetoes.size(), 2U);
  EXPECT_EQ(found.vetoes.count(samples_[2].record.id), 1U);
  EXPECT_EQ(found.vetoes.count(samples_[5].record.id), 1U);
  EXPECT_TRUE(found.points.empty());
}

TEST_F(Corrections, TheFilesAreReadByTheBuild) {
  json moved = coco_;
  moved["annotations"][0]["keypoints"][1] = 17.25;
  moved["annotations"].erase(3);
  const CocoChanges found = changes(moved);
  write_changes(found, scratch_.path() / "changes");
  auto read = candidates::read_corrections(scratch_.path() / "changes/corrections.tsv");
  const std::string& id = samples_[0].record.id;
  ASSERT_EQ(read.points.size(), 1U);
  EXPECT_EQ(read.points.at(id)[0].y_px, found.points.at(id)[0].y_px);  // to the last bit
  std::vector<manifests::SampleRecord> records{samples_[0].record, samples_[1].record};
  candidates::apply_corrections(read, records);
  EXPECT_EQ(read.matched, 1U);
  EXPECT_EQ(records[0].keypoints[0].y_px, found.points.at(id)[0].y_px);
  EXPECT_EQ(records[0].keypoints[1].x_px, samples_[0].record.keypoints[1].x_px);
  EXPECT_EQ(records[1].keypoints[0].y_px, samples_[1].record.keypoints[0].y_px);
}

TEST_F(Corrections, WhatCannotBeMatchedIsTold) {
  json other = coco_;
  other["images"][0]["file_name"] = "unknown.jpg";
  EXPECT_THROW(changes(other), std::runtime_error);
  other = coco_;
  other["annotations"].push_back(other["annotations"][0]);
  EXPECT_THROW(changes(other), std::runtime_error);
  other = coco_;
  other["categories"][0]["keypoints"][0] = "left_horn";
  EXPECT_THROW(changes(other), std::runtime_error);
  other = coco_;
  other["annotations"][0]["keypoints"][2] = 0.7;
  EXPECT_THROW(changes(other), std::runtime_error);
}

TEST(CorrectionsFile, LinesThatAreNoPointsAreTold) {
  const testing::ScratchDir scratch;
  const fs::path file = scratch.path() / "corrections.tsv";
  for (const char* line :
       {"zoo/train/a.jpg#0\tleft_eye\t1\t2", "zoo/train/a.jpg#0\tleft_horn\t1\t2\t2",
        "zoo/train/a.jpg#0\tleft_eye\tone\t2\t2", "zoo/train/a.jpg#0\tleft_eye\t1\t2\t3"}) {
    manifests::write_file_atomically(file, std::string(line) + "\n");
    EXPECT_THROW(candidates::read_corrections(file), run::ConfigError) << line;
  }
  EXPECT_THROW(candidates::read_corrections(scratch.path() / "absent.tsv"), run::ConfigError);
}

}  // namespace
}  // namespace q3d::pipeline::exports
