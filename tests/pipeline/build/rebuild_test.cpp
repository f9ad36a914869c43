// Builds that meet damaged files of an earlier build, or disks that fail. The datasets bring their labels, so
// no network is needed.
#include <gmock/gmock.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "manifests/atomic_file.h"
#include "manifests/file_descriptor.h"
#include "pipeline/build/build.h"
#include "pipeline/dataset/verify.h"
#include "tests/support/failing_io.h"
#include "tests/support/paths.h"
#include "tests/support/told.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using testing::Call;
using ::testing::Contains;
using testing::FailingIo;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kPictures = 6;
constexpr int kUnitSize = 2;

class Rebuild : public ::testing::Test {
 protected:
  Rebuild() {
    json records = json::array();
    for (int i = 0; i < kPictures; ++i) records.push_back(record(i));
    fs::create_directories(scratch_.path() / "data");
    std::ofstream(scratch_.path() / "data/train.json") << json{{"data", records}};
  }

  json record(int i) {
    const std::string name = "images/p" + std::to_string(i) + ".png";
    save_picture(name, cv::Mat(90, 120, CV_8UC3, cv::Scalar(10 * i, 120, 200)));
    const std::string mask = "masks/m" + std::to_string(i) + ".png";
    cv::Mat silhouette(90, 120, CV_8UC1, cv::Scalar(0));
    silhouette(cv::Rect(20, 20, 60, 50)) = 255;
    save_picture(mask, silhouette);
    json keypoints = json::array();
    for (int k = 0; k < 26; ++k) keypoints.push_back({20 + 2 * k, 25 + k, 1});
    return {{"img_path", name},
            {"mask_path", mask},
            {"bbox", {10, 10, 80, 70}},
            {"keypoint_2d", keypoints},
            {"pose", std::vector<double>(105, 0.01 * (i + 1))},
            {"shape", std::vector<double>(20, 0.2)},
            {"shape_extra", std::vector<double>(21, 0.3)},
            {"trans", {0.1, 0.2, 5.0}},
            {"supercategory", 2}};
  }

  void save_picture(const std::string& name, const cv::Mat& picture) {
    std::vector<std::uint8_t> png;
    cv::imencode(".png", picture, png);
    write(scratch_.path() / "data" / name, {reinterpret_cast<const char*>(png.data()), png.size()});
  }

  // Writes in place, as damage does: the inode stays, and so do other names of the file.
  static void write(const fs::path& path, std::string_view content) {
    fs::create_directories(path.parent_path());
    std::error_code ignored;
    fs::permissions(path, fs::perms::owner_write, fs::perm_options::add, ignored);
    std::ofstream(path, std::ios::binary) << content;
  }

  static void flip_bit(const fs::path& path, std::size_t at) {
    std::string content = manifests::read_file(path);
    content.at(at) ^= 4;
    write(path, content);
  }

  BuildSummary run(const std::string& out, int jpeg_quality = 95) {
    const json config = {{"name", "tiny"},
                         {"datasets",
                          {{{"name", "tiny"},
                            {"format", "prima"},
                            {"root", (scratch_.path() / "data").string()},
                            {"annotations", "train.json"},
                            {"role", "truth"}}}},
                         {"shards", {{"unit_size", kUnitSize}, {"jpeg_quality", jpeg_quality}}}};
    run::RunOptions options;
    options.out = scratch_.path() / out;
    options.quiet = true;
    told_.clear();
    return build(config::parse_build_config(config, "t"), options);
  }

  fs::path stage(const std::string& out, const std::string& name) const {
    for (const auto& entry : fs::directory_iterator(scratch_.path() / out / "stages")) {
      if (entry.path().filename().string().starts_with(name + "-")) return entry.path();
    }
    throw std::logic_error("no stage " + name);
  }

  // Removes what starts with one of `beginnings` from the output folder and its stages.
  void remove_from(const std::string& out, const std::vector<std::string>& beginnings) {
    for (const fs::path& folder : {scratch_.path() / out / "stages", scratch_.path() / out}) {
      const std::vector<fs::directory_entry> entries{fs::directory_iterator(folder), {}};
      for (const auto& entry : entries) {
        const std::string name = entry.path().filename().string();
        const auto starts = [&](const std::string& beginning) { return name.starts_with(beginning); };
        if (std::any_of(beginnings.begin(), beginnings.end(), starts)) fs::remove_all(entry.path());
      }
    }
  }

  static std::map<std::string, std::string> files(const fs::path& folder) {
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) {
        contents[entry.path().lexically_relative(folder)] = manifests::read_file(entry.path());
      }
    }
    return contents;
  }

  std::size_t journal_lines(const std::string& out) const {
    std::size_t lines = 0;
    const fs::path stages = scratch_.path() / out / "stages";
    if (!fs::exists(stages)) return 0;
    for (const auto& entry : fs::recursive_directory_iterator(stages)) {
      if (entry.path().filename() != "journal.jsonl") continue;
      const std::string text = manifests::read_file(entry.path());
      lines += static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
    }
    return lines;
  }

  testing::ScratchDir scratch_;
  q3d::testing::Told told_log_;
  std::vector<std::string>& told_ = told_log_.warnings;
};

// Labels come from the predict table here; a flipped bit in it must never reach a shard.
TEST_F(Rebuild, AFlippedBitInAStageTableNeverReachesAnotherVersion) {
  run("out");
  const auto expected = files(run("fresh", 80).folder);
  int versions = 0;
  for (const std::string name : {"predict", "refine"}) {
    const fs::path table = stage("out", name) / "unit-000001.h5";
    const std::string sound = manifests::read_file(table);
    for (std::size_t at = 11; at < sound.size(); at += sound.size() / 12) {
      flip_bit(table, at);
      const BuildSummary summary = run("out", 80);
      ASSERT_EQ(files(summary.folder), expected) << name << " byte " << at;
      ASSERT_THAT(told_, Contains(AllOf(HasSubstr(table.string()), HasSubstr("unit 1 "))));
      ASSERT_EQ(manifests::read_file(table), sound);
      remove_from("out", {"tiny-", "shards-"});  // so that the next build packs the tables again
      ++versions;
    }
  }
  EXPECT_GE(versions, 24);
}

TEST_F(Rebuild, ASoundBuildIsUpToDateAndTellsNothing) {
  EXPECT_FALSE(run("out").was_up_to_date);
  EXPECT_TRUE(run("out").was_up_to_date);
  EXPECT_THAT(told_, IsEmpty());
}

// The published shard and the stage's are one file with two names.
TEST_F(Rebuild, ADamagedPublishedShardIsNotUpToDateAndIsMadeAnew) {
  const BuildSummary first = run("out");
  const auto sound = files(first.folder);
  const fs::path shard = first.folder / "shards/000001.h5";
  for (std::size_t at = 5; at < fs::file_size(shard); at += fs::file_size(shard) / 7) {
    flip_bit(shard, at);
    const BuildSummary again = run("out");
    EXPECT_FALSE(again.was_up_to_date);
    EXPECT_EQ(files(again.folder), sound) << "byte " << at;
    EXPECT_THAT(told_, Contains(HasSubstr(shard.string())));
    EXPECT_THAT(told_, Contains(HasSubstr((stage("out", "shards") / "unit-000001.h5").string())));
    EXPECT_THAT(dataset::verify(again.folder, true).problems, IsEmpty());
    EXPECT_TRUE(run("out").was_up_to_date);
  }
}

TEST_F(Rebuild, APublishedShardThatWasReplacedIsPublishedAgain) {
  const BuildSummary first = run("out");
  const auto sound = files(first.folder);
  const fs::path shard = first.folder / "shards/000002.h5";
  const std::string content = manifests::read_file(shard);
  fs::remove(shard);
  write(shard, std::string(content.size(), 'x'));  // the same size, another inode
  EXPECT_FALSE(run("out").was_up_to_date);
  EXPECT_EQ(files(first.folder), sound);
  EXPECT_THAT(told_, ::testing::ElementsAre(HasSubstr(shard.string()))) << "the stage's file is sound";
}

TEST_F(Rebuild, TheNaturalRepairsDoNotLinkADamagedStageFileAgain) {
  const BuildSummary first = run("out");
  const auto sound = files(first.folder);
  const std::vector<std::function<void()>> repairs = {[&] { fs::remove(first.folder / "shards/000000.h5"); },
                                                      [&] { fs::remove_all(first.folder); }};
  for (const auto& repair : repairs) {
    flip_bit(stage("out", "shards") / "unit-000000.h5", 3000);
    repair();
    EXPECT_FALSE(run("out").was_up_to_date);
    EXPECT_EQ(files(first.folder), sound);
  }
}

TEST_F(Rebuild, ADamagedShardOfTheStageIsNotLinkedIntoAnotherVersion) {
  const BuildSummary first = run("out");
  const auto sound = files(first.folder);
  const fs::path shard = stage("out", "shards") / "unit-000000.h5";
  flip_bit(shard, 4000);
  json annotations = json::parse(manifests::read_file(scratch_.path() / "data/train.json"));
  annotations["data"].push_back(record(kPictures));  // one more unit, so another version with the same shards
  write(scratch_.path() / "data/train.json", annotations.dump());
  const BuildSummary second = run("out");
  ASSERT_NE(second.folder, first.folder);
  EXPECT_THAT(told_, ::testing::ElementsAre(HasSubstr(shard.string())));
  EXPECT_EQ(manifests::read_file(second.folder / "shards/000000.h5"), sound.at("shards/000000.h5"));
  EXPECT_EQ(second.dataset.content_id, run("fresh").dataset.content_id);
}

TEST_F(Rebuild, DamagedBooksArePublishedAgain) {
  const BuildSummary first = run("out");
  const auto sound = files(first.folder);
  flip_bit(first.folder / "verdicts.csv", 200);
  EXPECT_FALSE(run("out").was_up_to_date);
  EXPECT_EQ(files(first.folder), sound);
  EXPECT_THAT(told_, ::testing::ElementsAre(HasSubstr("verdicts.csv")));
  write(first.folder / "dataset.json", sound.at("dataset.json").substr(0, 100));
  EXPECT_FALSE(run("out").was_up_to_date);
  EXPECT_EQ(files(first.folder), sound);
  EXPECT_THAT(told_, ::testing::ElementsAre(HasSubstr("dataset.json")));
}

TEST_F(Rebuild, DamagedJournalsAndManifestsAreMadeAnew) {
  const auto expected = files(run("fresh", 80).folder);
  run("out");
  for (const std::string name : {"predict", "refine", "shards"}) {
    flip_bit(stage("out", name) / "journal.jsonl", 30);
    write(stage("out", name) / "manifest.json", "{\"stage\": ");
  }
  EXPECT_EQ(files(run("out", 80).folder), expected);
  EXPECT_EQ(told_.size(), 4U) << "a line and a manifest of predict and of refine";
  run("out", 80);
  EXPECT_THAT(told_, IsEmpty());
}

struct Failure {
  Call call;
  const char* file;
  int code;
};

class FailingDisk : public Rebuild, public ::testing::WithParamInterface<Failure> {
 protected:
  // The build stops with the error, and the same command gives the expected files once the disk works.
  void expect_stop(const std::map<std::string, std::string>& expected) {
    const auto [call, file, code] = GetParam();
    {
      const FailingIo io(call, file, code);
      try {
        run("out");
        FAIL() << "the build went on";
      } catch (const manifests::IoError& error) {
        EXPECT_EQ(error.code(), code);
        const fs::path path = scratch_.path() / "data" / file;
        EXPECT_THAT(error.what(), AllOf(HasSubstr(path.string()), HasSubstr(std::strerror(code))));
      }
      EXPECT_GE(io.failures(), 1);
    }
    EXPECT_FALSE(fs::exists(scratch_.path() / "out/latest"));
    const std::size_t of_one_unit = 3;  // predict, refine and shards
    EXPECT_LE(journal_lines("out"), of_one_unit * (kPictures / kUnitSize - 1));
    EXPECT_EQ(files(run("out").folder), expected);
  }
};

TEST_P(FailingDisk, StopsTheRunWhilePicturesAreDigested) {
  expect_stop(files(run("fresh").folder));
}

TEST_P(FailingDisk, StopsTheRunWhilePicturesAreDecoded) {
  // Files that are old enough are digested once: their digests come from the cache afterwards.
  for (const auto& entry : fs::recursive_directory_iterator(scratch_.path() / "data")) {
    fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - std::chrono::hours(1));
  }
  const auto expected = files(run("out").folder);
  remove_from("out", {"tiny-", "latest", "stages"});
  ASSERT_TRUE(fs::exists(scratch_.path() / "out/digests.txt"));
  expect_stop(expected);
}

INSTANTIATE_TEST_SUITE_P(Errors, FailingDisk,
                         ::testing::Values(Failure{Call::read, "images/p3.png", EIO},
                                           Failure{Call::read, "images/p0.png", ESTALE},
                                           Failure{Call::open, "images/p3.png", EMFILE},
                                           Failure{Call::open, "images/p5.png", EACCES},
                                           Failure{Call::read, "masks/m2.png", EIO},
                                           Failure{Call::open, "masks/m2.png", ENOTCONN}));

TEST_F(Rebuild, AnnotationsThatCannotBeReadStopTheRun) {
  const FailingIo io(Call::read, "/train.json", ETIMEDOUT);
  EXPECT_THROW(run("out"), manifests::IoError);
}

TEST_F(Rebuild, APictureThatIsNotThereIsAFailedSample) {
  fs::remove(scratch_.path() / "data/images/p3.png");
  const BuildSummary summary = run("out");
  EXPECT_EQ(summary.dataset.counts.failed, 1);
  EXPECT_EQ(summary.dataset.reasons.at(manifests::Reason::image_missing), 1);
}

}  // namespace
}  // namespace q3d::pipeline::build
