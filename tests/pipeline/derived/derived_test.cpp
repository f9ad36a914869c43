// Versions made from versions, checked by `verify`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "manifests/atomic_file.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/dataset/verify.h"
#include "pipeline/derived/difference.h"
#include "pipeline/derived/operations.h"
#include "pipeline/run/errors.h"
#include "tests/pipeline/exports/body_dataset.h"
#include "tests/pipeline/exports/body_samples.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::derived {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class Derived : public ::testing::Test {
 protected:
  Derived()
      : dogs_(testing::make_body_dataset(scratch_.path(), "dogs", {"a", "b"}, 1)),
        wolves_(testing::make_body_dataset(scratch_.path(), "wolves", {"c", "b"}, 101)) {}

  static void expect_sound(const fs::path& folder, std::int64_t samples) {
    const dataset::VerifySummary summary = dataset::verify(folder, true);
    EXPECT_THAT(summary.problems, IsEmpty());
    EXPECT_EQ(summary.samples, samples);
    EXPECT_EQ(summary.pictures, samples);
  }

  fs::path out() const { return scratch_.path() / "out"; }

  testing::ScratchDir scratch_;
  testing::BodyDataset dogs_;
  testing::BodyDataset wolves_;
};

TEST_F(Derived, TheMadeDatasetIsSoundItself) {
  expect_sound(dogs_.folder, 8);
}

TEST_F(Derived, MergeHasAllCandidatesOnceAndTellsDuplicates) {
  const MergeSummary summary = merge({dogs_.folder, wolves_.folder}, out(), "", "1.0.0");
  expect_sound(summary.version.folder, 12);  // wolves' shard b has the ids of dogs' shard b
  EXPECT_THAT(summary.repeated_ids, ElementsAre("zoo/train/b_0.jpg#0", "zoo/train/b_1.jpg#1",
                                                "zoo/train/b_2.jpg#2", "zoo/train/b_3.jpg#3"));
  EXPECT_EQ(summary.version.counts.discarded, 2);
  EXPECT_EQ(summary.version.shards_linked, 2);
  EXPECT_EQ(summary.version.shards_written, 1);
  EXPECT_TRUE(summary.version.folder.filename().string().starts_with("dogs+wolves-"));
  // The first version's label is taken.
  const dataset::PublishedDataset merged(summary.version.folder);
  const manifests::ShardSample kept = merged.sample(merged.verdict("zoo/train/b_1.jpg#1"));
  EXPECT_EQ(kept.keypoints_3d, dogs_.samples[5].keypoints_3d);
  EXPECT_NE(kept.keypoints_3d, wolves_.samples[5].keypoints_3d);
  // Pictures are copied byte for byte, linked shards are the same file.
  const manifests::ShardSample wolf = merged.sample(merged.verdict("zoo/train/c_1.jpg#1"));
  EXPECT_EQ(wolf.crop, wolves_.samples[1].crop);
  EXPECT_TRUE(fs::equivalent(summary.version.folder / "shards/000000.h5", dogs_.folder / "shards/000000.h5"));
  // Both provenances are there.
  const auto document = nlohmann::json::parse(manifests::read_file(summary.version.folder / "dataset.json"));
  const auto& from = document.at("provenance").at("derived").at("from");
  ASSERT_EQ(from.size(), 2U);
  EXPECT_EQ(from[1].at("content_id"), wolves_.document.at("content_id"));
  EXPECT_EQ(from[1].at("provenance"), wolves_.document.at("provenance"));
  EXPECT_TRUE(merge({dogs_.folder, wolves_.folder}, out(), "", "1.0.0").version.was_up_to_date);
}

TEST_F(Derived, ADamagedVersionIsWrittenAgain) {
  const auto merged = [&] { return merge({dogs_.folder, wolves_.folder}, out(), "", "1.0.0").version; };
  const DerivedVersion first = merged();
  EXPECT_TRUE(merged().was_up_to_date);
  const dataset::PublishedDataset made(first.folder);
  const std::string document = manifests::read_file(first.folder / "dataset.json");
  for (const fs::path& damaged : {made.shard_file(made.manifest().shards.front()), made.verdicts_file()}) {
    fs::remove(damaged);
    EXPECT_FALSE(merged().was_up_to_date);
    expect_sound(first.folder, first.counts.retained + first.counts.refined);
  }
  manifests::write_file_atomically(first.folder / "dataset.json", document + " ");
  EXPECT_FALSE(merged().was_up_to_date);
  EXPECT_EQ(manifests::read_file(first.folder / "dataset.json"), document);
}

TEST_F(Derived, VersionsThatDoNotFitAreRefused) {
  wolves_.document["thresholds"]["zoo"]["tau_low"] = 0.06;
  wolves_.write_document();
  EXPECT_THROW(merge({dogs_.folder, wolves_.folder}, out(), "", "1.0.0"), run::ConfigError);
  EXPECT_FALSE(fs::exists(out()));
  EXPECT_THROW(merge({dogs_.folder}, out(), "", "1.0.0"), run::ConfigError);
}

TEST_F(Derived, SubsetLinksWholeShardsAndWritesTheOthersAnew) {
  // All of shard a but none of b, and one row of b.
  const DerivedVersion version =
      subset(dogs_.folder,
             "id = zoo/train/a_0.jpg#0 or id = zoo/train/a_1.jpg#1 or id = zoo/train/a_2.jpg#2 or "
             "id = zoo/train/a_3.jpg#3 or id = zoo/train/b_2.jpg#2",
             out(), "few", "2.0.0");
  expect_sound(version.folder, 5);
  EXPECT_EQ(version.shards_linked, 1);
  EXPECT_EQ(version.shards_written, 1);
  const dataset::PublishedDataset few(version.folder);
  EXPECT_EQ(few.manifest().counts.candidates, 5);
  EXPECT_EQ(few.manifest().version, "2.0.0");
  const manifests::ShardSample sample = few.sample(few.verdict("zoo/train/b_2.jpg#2"));
  EXPECT_EQ(sample.crop, dogs_.samples[6].crop);
  EXPECT_EQ(sample.body.pose, dogs_.samples[6].body.pose);
}

TEST_F(Derived, SubsetTakesWhatFulfilsTheCondition) {
  const DerivedVersion version = subset(dogs_.folder, "species = \"red fox\"", out(), "", "1.0.0");
  const auto foxes = std::count_if(dogs_.samples.begin(), dogs_.samples.end(),
                                   [](const auto& sample) { return sample.record.species == "red fox"; });
  ASSERT_GT(foxes, 0);
  expect_sound(version.folder, foxes);
  EXPECT_THROW(subset(dogs_.folder, "species = okapi", out(), "", "1.0.0"), run::ConfigError);
}

TEST_F(Derived, DiffTellsCandidatesVerdictsAndLabels) {
  const VersionDifference same = compare_versions(dogs_.folder, dogs_.folder);
  EXPECT_EQ(same.in_both, 9);
  EXPECT_EQ(same.equal_labels, 8);
  EXPECT_TRUE(same.labels.empty());
  const VersionDifference other = compare_versions(dogs_.folder, wolves_.folder);
  EXPECT_EQ(other.in_both, 4);
  EXPECT_EQ(other.only_before.size(), 5U);
  EXPECT_EQ(other.only_after.size(), 5U);
  EXPECT_EQ(other.equal_labels, 0);
  ASSERT_EQ(other.labels.size(), 4U);
  EXPECT_TRUE(std::is_sorted(other.labels.begin(), other.labels.end(), [](const auto& a, const auto& b) {
    return a.keypoints_3d_mm > b.keypoints_3d_mm;
  }));
  // The expected values for one of them are computed by hand.
  const auto change = std::find_if(other.labels.begin(), other.labels.end(),
                                   [](const auto& each) { return each.id == "zoo/train/b_0.jpg#0"; });
  ASSERT_NE(change, other.labels.end());
  const manifests::ShardSample& a = dogs_.samples[4];
  const manifests::ShardSample& b = wolves_.samples[4];
  double millimetres = 0.0;
  for (std::size_t k = 0; k < 26; ++k) {
    millimetres += 1000.0 / 26.0 *
                   std::hypot(a.keypoints_3d[3 * k] - b.keypoints_3d[3 * k],
                              a.keypoints_3d[3 * k + 1] - b.keypoints_3d[3 * k + 1],
                              a.keypoints_3d[3 * k + 2] - b.keypoints_3d[3 * k + 2]);
  }
  EXPECT_NEAR(change->keypoints_3d_mm, millimetres, 1e-3);
  EXPECT_EQ(change->error_before, a.judgement.final_error);
  EXPECT_EQ(to_json(other).at("labels").size(), 4U);
  EXPECT_THAT(page_of(other), ::testing::HasSubstr("labels of both: 0 equal, 4 changed"));
}

}  // namespace
}  // namespace q3d::pipeline::derived
