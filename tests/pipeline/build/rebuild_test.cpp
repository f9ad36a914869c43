// Builds that meet damaged files of an earlier build, or disks that fail. The datasets bring their labels, so
// no network is needed.
#include <gmock/gmock.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <functional>
#include <mutex>

#include "manifests/file_descriptor.h"
#include "pipeline/dataset/verify.h"
#include "tests/pipeline/build/rebuild_fixture.h"
#include "tests/support/failing_io.h"

namespace q3d::pipeline::build {
namespace {

using ::testing::AllOf;
using testing::Call;
using ::testing::Contains;
using testing::FailingIo;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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

TEST_F(Rebuild, AFlippedBitOfDatasetJsonIsPublishedAgain) {
  const BuildSummary first = run("out");
  const auto sound = files(first.folder);
  const fs::path file = first.folder / "dataset.json";
  for (std::size_t at = 3; at < fs::file_size(file); at += fs::file_size(file) / 11) {
    flip_bit(file, at);
    EXPECT_FALSE(run("out").was_up_to_date) << "byte " << at;
    EXPECT_EQ(files(first.folder), sound) << "byte " << at;
    EXPECT_THAT(told_, ::testing::ElementsAre(AllOf(HasSubstr(file.string()), HasSubstr("published again"))));
  }
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

TEST_F(Rebuild, CellsThatASpreadsheetWouldRunAreToldAndStayAsTheyAre) {
  config::BuildConfig changed = config();
  changed.datasets.front().split = "=cmd|'C calc'!A0";
  run::RunOptions options;
  options.out = scratch_.path() / "out";
  options.quiet = true;
  const BuildSummary summary = build(changed, options);
  EXPECT_THAT(manifests::read_file(summary.folder / "verdicts.csv"), HasSubstr(",=cmd|'C calc'!A0,"));
  EXPECT_THAT(told_, Contains(HasSubstr("6 cells of verdicts.csv begin with =, +, - or @")));
}

// A path may hold any bytes but zero; JSON takes UTF-8 alone.
TEST_F(Rebuild, AnOutputFolderWhoseNameIsNoUtf8IsBuiltInto) {
  run::RunOptions options;
  options.out = scratch_.path() / "caf\xe9";
  options.quiet = true;
  BuildRequest request;
  request.command = {"build", "--out", options.out.string()};
  EXPECT_FALSE(build(config(), options, request).was_up_to_date);
  EXPECT_TRUE(build(config(), options, request).was_up_to_date);
}

TEST_F(Rebuild, AnnotationsWithoutARecordAreTold) {
  write(scratch_.path() / "data/train.json", R"({"data": []})");
  EXPECT_THAT([&] { run("out"); },
              ::testing::ThrowsMessage<std::runtime_error>(HasSubstr("there are no candidates")));
}

// A file whose bytes change while its size, time and inode stay keeps its remembered digest.
class Rotten : public Rebuild, public ::testing::WithParamInterface<const char*> {};

TEST_P(Rotten, APictureOrMaskIsNeverUsedUnderTheDigestOfItsEarlierBytes) {
  const fs::path file = scratch_.path() / "data" / GetParam();
  const auto earlier = fs::last_write_time(file) - std::chrono::hours(1);
  fs::last_write_time(file, earlier);
  run("out");
  const std::string content = manifests::read_file(file);
  flip_bit(file, content.size() / 2);
  fs::last_write_time(file, earlier);
  try {
    run("out", /*jpeg_quality=*/90);
    FAIL() << "the build has used the damaged file";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr(GetParam()), HasSubstr("replaced or damaged")));
  }
  write(file, content);
  EXPECT_NO_THROW(run("out", /*jpeg_quality=*/90));
}

INSTANTIATE_TEST_SUITE_P(Files, Rotten, ::testing::Values("images/p3.png", "masks/m3.png"));

TEST_F(Rebuild, APictureThatIsNotThereIsAFailedSample) {
  fs::remove(scratch_.path() / "data/images/p3.png");
  const BuildSummary summary = run("out");
  EXPECT_EQ(summary.dataset.counts.failed, 1);
  EXPECT_EQ(summary.dataset.reasons.at(manifests::Reason::image_missing), 1);
}

}  // namespace
}  // namespace q3d::pipeline::build
