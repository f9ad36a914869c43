// verify --repair: what was damaged is made again, to the same bytes, and nothing else is touched.
#include "pipeline/build/repair.h"

#include <gmock/gmock.h>

#include "manifests/file_descriptor.h"
#include "manifests/lock.h"
#include "pipeline/dataset/verify.h"
#include "pipeline/run/errors.h"
#include "tests/pipeline/build/rebuild_fixture.h"
#include "tests/support/failing_io.h"

namespace q3d::pipeline::build {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

class Repair : public Rebuild {
 protected:
  Repair() {
    first_ = run("out");
    sound_ = files(out_);
  }

  RepairSummary mend(bool with_config = true, int jpeg_quality = 95) {
    run::RunOptions options;
    options.quiet = true;
    return repair(first_.folder, with_config ? std::optional(config(jpeg_quality)) : std::nullopt, options);
  }

  // All files of the output folder but the quarantine. Only the digest cache, the lock and the journals may
  // differ.
  void expect_as_before() {
    auto now = files(out_);
    for (const auto& [name, content] : sound_) {
      if (name == "digests.txt" || name == ".lock" || name.ends_with("journal.jsonl")) continue;
      EXPECT_TRUE(now.contains(name) && now.at(name) == content) << name;
    }
    EXPECT_THAT(dataset::verify(first_.folder, true, true).problems, IsEmpty());
  }

  fs::path out_ = scratch_.path() / "out";
  BuildSummary first_;
  std::map<std::string, std::string> sound_;
};

TEST_F(Repair, ASoundDatasetIsLeftAsItIs) {
  const RepairSummary summary = mend();
  EXPECT_THAT(summary.problems, IsEmpty());
  EXPECT_FALSE(summary.was_built);
  EXPECT_FALSE(fs::exists(out_ / "quarantine"));
}

// A file that the disk refuses to give may be sound.
TEST_F(Repair, AFileThatCannotBeReadIsNotMovedAway) {
  for (const char* file : {"/shards/000001.h5", "/verdicts.csv"}) {
    const testing::FailingIo io(testing::Call::open, file, EACCES);
    EXPECT_THROW(mend(), manifests::IoError);
  }
  EXPECT_FALSE(fs::exists(out_ / "quarantine"));
  expect_as_before();
}

TEST_F(Repair, ABuildThatWorksMeanwhileIsNotDisturbed) {
  flip_bit(first_.folder / "shards/000001.h5", 3000);
  const manifests::FolderLock working(out_);
  EXPECT_THROW(mend(), std::runtime_error);
  EXPECT_FALSE(fs::exists(out_ / "quarantine"));
}

// The published shard and the stage's are one file with two names, so that both are damaged.
TEST_F(Repair, AShardIsMadeAgainFromTheSources) {
  const fs::path shard = first_.folder / "shards/000001.h5";
  flip_bit(shard, 3000);
  const std::string damaged = manifests::read_file(shard);
  const RepairSummary summary = mend();
  EXPECT_THAT(summary.unrepaired, IsEmpty());
  EXPECT_TRUE(summary.was_built);
  const fs::path in_stage = stage("out", "shards").filename() / "unit-000001.h5";
  EXPECT_THAT(summary.quarantined,
              UnorderedElementsAre(out_ / "quarantine" / first_.folder.filename() / "shards/000001.h5",
                                   out_ / "quarantine/stages" / in_stage));
  for (const fs::path& place : summary.quarantined) EXPECT_EQ(manifests::read_file(place), damaged);
  expect_as_before();
}

TEST_F(Repair, TemporaryFilesOfAKilledRepairAreRemoved) {
  const std::vector<fs::path> left{first_.folder / ".dataset.json.Ab12Cd.tmp",
                                   first_.folder / "shards/.000001.h5.Ab12Cd.tmp"};
  for (const fs::path& file : left) write(file, "half");
  EXPECT_THAT(mend().unrepaired, IsEmpty());
  for (const fs::path& file : left) EXPECT_FALSE(fs::exists(file)) << file;
  expect_as_before();
}

TEST_F(Repair, AShardWithACopyNeedsNoConfig) {
  const fs::path shard = first_.folder / "shards/000000.h5";
  fs::remove(shard);
  write(shard, "rot");
  const RepairSummary summary = mend(/*with_config=*/false);
  EXPECT_THAT(summary.unrepaired, IsEmpty());
  EXPECT_THAT(summary.copied, ElementsAre(shard));
  expect_as_before();
}

TEST_F(Repair, ExactlyTheDamagedUnitsOfTheStagesAreMadeAgain) {
  for (const std::string name : {"predict", "refine", "crops", "shards"}) {
    const fs::path table = stage("out", name) / "unit-000002.h5";
    const fs::path other = stage("out", name) / "unit-000001.h5";
    const auto untouched = fs::last_write_time(other);
    flip_bit(table, 2000);
    if (name != "shards") {
      EXPECT_THAT(dataset::verify(first_.folder, true).problems, IsEmpty());
    }
    EXPECT_THAT(dataset::verify(first_.folder, true, true).problems,
                Contains(HasSubstr("unit-000002.h5: SHA-256 is")));
    EXPECT_THAT(mend().unrepaired, IsEmpty()) << name;
    EXPECT_EQ(fs::last_write_time(other), untouched) << name;
    expect_as_before();
  }
}

TEST_F(Repair, BooksJournalsAndManifestsAreMadeAgain) {
  flip_bit(first_.folder / "dataset.json", 500);
  flip_bit(stage("out", "predict") / "journal.jsonl", 30);
  EXPECT_THAT(mend().unrepaired, IsEmpty());
  expect_as_before();
  flip_bit(first_.folder / "verdicts.csv", 300);
  write(stage("out", "refine") / "manifest.json", "{\"stage\": ");
  EXPECT_THAT(mend().unrepaired, IsEmpty());
  expect_as_before();
  flip_bit(stage("out", "crops") / "manifest.json",
           60);  // in the part of the key that the folder's name lacks
  EXPECT_THAT(dataset::verify(first_.folder, true, true).problems, Contains(HasSubstr("no readable key")));
  EXPECT_THAT(mend().unrepaired, IsEmpty());
  expect_as_before();
}

TEST_F(Repair, TellsWhatItCannotRepair) {
  flip_bit(first_.folder / "shards/000001.h5", 3000);
  const RepairSummary summary = mend(/*with_config=*/false);
  EXPECT_EQ(summary.quarantined.size(), 2U);
  EXPECT_THAT(summary.unrepaired, Contains(HasSubstr("shards/000001.h5")));
  EXPECT_THAT(mend().unrepaired, IsEmpty()) << "the config makes it again";
  expect_as_before();
}

TEST_F(Repair, APictureThatChangedSinceCannotGiveTheSameBytes) {
  flip_bit(first_.folder / "shards/000000.h5", 3000);
  save_picture("images/p0.png", cv::Mat(90, 120, CV_8UC3, cv::Scalar(1, 2, 3)));
  const RepairSummary summary = mend();
  EXPECT_THAT(summary.unrepaired, Contains(HasSubstr("now give another dataset")));
  EXPECT_THAT(summary.unrepaired, Contains(HasSubstr("shards/000000.h5")));
}

TEST_F(Repair, RefusesTheConfigOfAnotherBuild) {
  flip_bit(first_.folder / "shards/000001.h5", 3000);
  EXPECT_THROW(mend(true, 80), run::ConfigError);
  EXPECT_FALSE(fs::exists(out_ / "quarantine"));
}

TEST_F(Repair, AnOlderDatasetIsRepairedAndLatestStays) {
  const BuildSummary second = run("out", 80);
  flip_bit(first_.folder / "verdicts.csv", 200);
  EXPECT_THAT(mend().unrepaired, IsEmpty());
  EXPECT_TRUE(fs::equivalent(out_ / "latest", second.folder));
}

TEST_F(Repair, TheQuarantineKeepsEveryFile) {
  for (int i = 0; i < 3; ++i) {
    flip_bit(first_.folder / "verdicts.csv", 200);
    mend();
  }
  const fs::path folder = out_ / "quarantine" / first_.folder.filename();
  for (const char* name : {"verdicts.csv", "verdicts.csv.1", "verdicts.csv.2"}) {
    EXPECT_TRUE(fs::exists(folder / name)) << name;
  }
}

TEST_F(Repair, AFileThatDoesNotBelongToTheDatasetIsAProblem) {
  write(first_.folder / "notes.txt", "mine");
  EXPECT_THAT(dataset::verify(first_.folder, true).problems,
              ElementsAre("notes.txt: not listed in dataset.json"));
}

}  // namespace
}  // namespace q3d::pipeline::build
