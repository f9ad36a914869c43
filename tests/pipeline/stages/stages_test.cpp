#include "pipeline/stages/stages.h"

#include <gmock/gmock.h>

#include <fstream>
#include <functional>
#include <vector>

#include "manifests/atomic_file.h"
#include "tests/support/paths.h"
#include "tests/support/told.h"

namespace q3d::pipeline::stages {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct Inputs {
  config::BuildConfig config;
  config::JudgingRules rules;
  candidates::Ingest ingest;
  AssetDigests assets{"checkpoint", "asset", ""};
  std::string device = "cpu-2";

  Inputs() {
    config::DatasetConfig& dataset = config.datasets.emplace_back();
    dataset.name = "a";
    dataset.format = "prima";
    dataset.split = "train";
    dataset.root = "r";
    dataset.annotations = "t";
    ingest.annotation_digests["a/train"] = "digest";
    ingest.units.push_back({0, 0, 1, "unit", "unit"});
    limits().tau_low = 0.1;
    limits().tau_high = 0.2;
  }
  // The candidates of all inputs are the same.
  Inputs(const Inputs& other) : Inputs() {
    config = other.config;
    rules = other.rules;
    assets = other.assets;
    device = other.device;
  }
  filters::Thresholds& limits() { return rules.thresholds["a"]; }
  // The guards of the rules are those of the config.
  void guard(const std::function<void(config::GuardConfig&)>& change) {
    change(config.guards);
    rules.guards = config.guards;
  }
  StageKeys keys() const { return stage_keys(config, rules, ingest, assets, device); }
};

TEST(StageKeys, AChangedTauKeepsPredictionsAndRedoesTheRest) {
  Inputs inputs;
  const StageKeys before = inputs.keys();
  inputs.limits().tau_low = 0.11;
  const StageKeys after = inputs.keys();
  EXPECT_EQ(before.ingest, after.ingest);
  EXPECT_EQ(before.predict, after.predict);
  EXPECT_NE(before.fidelity, after.fidelity);
  EXPECT_NE(before.refine, after.refine);
  EXPECT_NE(before.shards, after.shards);
  EXPECT_NE(before.dataset, after.dataset);
}

TEST(StageKeys, AddedPhotosMakeANewVersionFromTheSameUnits) {
  Inputs inputs;
  const StageKeys before = inputs.keys();
  inputs.ingest.units.push_back({1, 1, 1, "more", "more"});
  const StageKeys after = inputs.keys();
  EXPECT_NE(before.ingest, after.ingest);
  EXPECT_EQ(before.predict, after.predict);
  EXPECT_EQ(before.shards, after.shards);
  EXPECT_NE(before.dataset, after.dataset);
}

TEST(StageKeys, ALeftOutSampleMakesANewVersionFromTheSamePredictions) {
  Inputs inputs;
  const StageKeys before = inputs.keys();
  inputs.ingest.units[0].label_digest = "without one";
  const StageKeys after = inputs.keys();
  EXPECT_EQ(before.predict, after.predict);
  EXPECT_EQ(before.refine, after.refine);
  EXPECT_NE(before.dataset, after.dataset);
}

TEST(StageKeys, WhatDecidesPredictionsIsInTheirKey) {
  const Inputs inputs;
  const std::string before = inputs.keys().predict;
  const auto changed = [&](auto&& change) {
    Inputs other;
    change(other);
    return other.keys().predict;
  };
  EXPECT_NE(before, changed([](Inputs& i) { i.assets.checkpoint = "x"; }));
  EXPECT_NE(before, changed([](Inputs& i) { i.assets.smal_asset = "x"; }));
  EXPECT_NE(before, changed([](Inputs& i) { i.device = "cpu-1"; }));
  EXPECT_NE(before, changed([](Inputs& i) { i.config.network.batch = 3; }));
  EXPECT_NE(before, changed([](Inputs& i) { i.config.network.dtype = config::Dtype::bfloat16; }));
  EXPECT_NE(before, changed([](Inputs& i) { i.config.shards.unit_size = 3; }));
  EXPECT_EQ(before, changed([](Inputs& i) { i.config.tta.learning_rate = 3; }));
  EXPECT_EQ(before, changed([](Inputs& i) { i.config.datasets[0].root = "elsewhere"; }));
}

TEST(StageKeys, WhatDecidesRefinementsAndShardsIsInTheirKeys) {
  const Inputs inputs;
  const StageKeys before = inputs.keys();
  Inputs rate;
  rate.config.tta.learning_rate = 1e-3;
  EXPECT_EQ(before.fidelity, rate.keys().fidelity);
  EXPECT_NE(before.refine, rate.keys().refine);
  Inputs quality;
  quality.config.shards.jpeg_quality = 50;
  EXPECT_EQ(before.refine, quality.keys().refine);
  EXPECT_NE(before.shards, quality.keys().shards);
}

TEST(StageKeys, WhatDecidesTheBytesOfStoredCropsAndNothingElseIsInTheirKey) {
  const std::string before = Inputs().keys().crops;
  const auto changed = [&](auto&& change) {
    Inputs other;
    change(other);
    return other.keys().crops != before;
  };
  EXPECT_TRUE(changed([](Inputs& i) { i.config.shards.jpeg_quality = 50; }));
  EXPECT_TRUE(changed([](Inputs& i) { i.config.shards.images = manifests::ImageEncoding::png; }));
  EXPECT_TRUE(changed([](Inputs& i) { i.config.shards.crop_scale = 2.5; }));
  EXPECT_TRUE(changed([](Inputs& i) { i.config.shards.crop_min_side_px = 300; }));
  EXPECT_TRUE(changed([](Inputs& i) { i.config.shards.unit_size = 3; }));
  EXPECT_FALSE(changed([](Inputs& i) { i.limits().tau_high = 0.3; }));
  EXPECT_FALSE(changed([](Inputs& i) { i.assets.checkpoint = "x"; }));
  EXPECT_FALSE(changed([](Inputs& i) { i.config.datasets[0].role = config::Role::truth; }));
  EXPECT_FALSE(changed([](Inputs& i) { i.config.name = "another"; }));
  Inputs png;
  png.config.shards.images = manifests::ImageEncoding::png;
  Inputs quality = png;
  quality.config.shards.jpeg_quality = 50;
  EXPECT_EQ(png.keys().crops, quality.keys().crops) << "a PNG has no quality";
}

TEST(StageKeys, WithoutPseudoLabelsNothingOfTheNetworkIsInThem) {
  Inputs inputs;
  inputs.config.datasets[0].role = config::Role::truth;
  const StageKeys before = inputs.keys();
  EXPECT_NE(before.predict, Inputs().keys().predict);
  Inputs other = inputs;
  other.config.network.batch = 3;
  other.config.tta.learning_rate = 3;
  other.limits().tau_low = 0.15;
  EXPECT_EQ(before.shards, other.keys().shards);
  EXPECT_EQ(before.dataset, other.keys().dataset);
  other.config.shards.jpeg_quality = 50;
  EXPECT_NE(before.shards, other.keys().shards);
}

TEST(StageKeys, AGuardThatChangesAdaptationRedoesRefinement) {
  const StageKeys before = Inputs().keys();
  for (const auto& change : std::vector<std::function<void(config::GuardConfig&)>>{
           [](config::GuardConfig& g) { g.iterations_full_at = 12; },
           [](config::GuardConfig& g) { g.held_out_share = 0.2; }}) {
    Inputs inputs;
    inputs.guard(change);
    const StageKeys after = inputs.keys();
    EXPECT_EQ(before.predict, after.predict);
    EXPECT_EQ(before.fidelity, after.fidelity);
    EXPECT_NE(before.refine, after.refine);
    EXPECT_NE(before.shards, after.shards);
    EXPECT_NE(before.measure, after.measure) << "other labels are measured";
  }
  Inputs seed;  // of nothing
  seed.guard([](config::GuardConfig& g) { g.held_out_seed = 5; });
  EXPECT_EQ(before.refine, seed.keys().refine);
}

TEST(StageKeys, AChangedBoundKeepsRefinementsAndMeasures) {
  const StageKeys none = Inputs().keys();
  EXPECT_NE(none.measure, "") << "trust scores are always measured";
  Inputs inputs;
  inputs.guard([](config::GuardConfig& g) { g.mask_iou_min = 0.5; });
  const StageKeys before = inputs.keys();
  EXPECT_EQ(none.refine, before.refine);
  EXPECT_EQ(none.measure, before.measure);
  EXPECT_NE(none.shards, before.shards);
  inputs.guard([](config::GuardConfig& g) { g.mask_iou_min = 0.6; });
  const StageKeys after = inputs.keys();
  EXPECT_EQ(before.predict, after.predict);
  EXPECT_EQ(before.refine, after.refine);
  EXPECT_EQ(before.measure, after.measure);
  EXPECT_NE(before.shards, after.shards);
  Inputs trusted;
  trusted.rules.min_trust = 0.5;
  EXPECT_EQ(none.measure, trusted.keys().measure);
  EXPECT_NE(none.shards, trusted.keys().shards);
  const StageKeys by_one = inputs.keys();
  inputs.assets.priors = "other priors";
  EXPECT_NE(by_one.measure, inputs.keys().measure);
  EXPECT_EQ(by_one.refine, inputs.keys().refine);
}

TEST(StageKeys, ThresholdsOfADatasetCount) {
  Inputs common;
  common.rules.thresholds["b"] = common.limits();
  EXPECT_EQ(Inputs().keys().fidelity, common.keys().fidelity) << "the same for all";
  Inputs own = common;
  own.rules.thresholds["b"].tau_low = 0.12;
  EXPECT_NE(common.keys().fidelity, own.keys().fidelity);
  EXPECT_EQ(common.keys().predict, own.keys().predict);
}

class StageFolder : public ::testing::Test {
 protected:
  void open(const std::string& key) { open_stage_folder(folder_, "predict", key); }
  void write_manifest(const std::string& text) { std::ofstream(folder_ / "manifest.json") << text; }

  testing::ScratchDir scratch_;
  const std::string key_ = std::string(64, 'a');
  std::filesystem::path folder_ = stage_folder(scratch_.path(), "predict", key_);
  q3d::testing::Told log_;
  std::vector<std::string>& told_ = log_.warnings;
};

TEST_F(StageFolder, RefusesAFolderOfAnotherKey) {
  open(key_);
  open(key_);
  EXPECT_THROW(open(std::string(64, 'b')), std::runtime_error);
  EXPECT_TRUE(told_.empty());
  write_manifest("{\"stage\": \"predict\", \"key\": \"" + std::string(63, 'a') + "b\"}");
  EXPECT_THROW(open(key_), std::runtime_error) << "the same first 12 digits, but another key";
}

TEST_F(StageFolder, WritesADamagedManifestAnew) {
  open(key_);
  const std::string sound = manifests::read_file(folder_ / "manifest.json");
  const std::vector<std::string> damaged = {"",
                                            sound.substr(0, sound.size() / 2),
                                            "[]",
                                            "{}",
                                            "{\"key\": 5}",
                                            "{\"key\": \"" + std::string(64, 'q') + "\"}"};
  for (const std::string& text : damaged) {
    told_.clear();
    write_manifest(text);
    open(key_);
    EXPECT_EQ(manifests::read_file(folder_ / "manifest.json"), sound) << text;
    ASSERT_EQ(told_.size(), 1U) << text;
    EXPECT_THAT(told_[0], AllOf(HasSubstr((folder_ / "manifest.json").string()), HasSubstr("damaged"),
                                HasSubstr(key_)));
  }
}

TEST_F(StageFolder, EveryFlippedBitOfAManifestIsFound) {
  open(key_);
  const std::string sound = manifests::read_file(folder_ / "manifest.json");
  for (std::size_t at = 0; at < 8 * sound.size(); ++at) {
    std::string damaged = sound;
    damaged[at / 8] = static_cast<char>(damaged[at / 8] ^ (1 << (at % 8)));
    write_manifest(damaged);
    EXPECT_EQ(key_in_manifest(folder_ / "manifest.json"), std::nullopt) << "bit " << at;
  }
}

TEST_F(StageFolder, RefusesADamagedManifestInAFolderOfAnotherName) {
  folder_ = scratch_.path() / "stages" / "predict-of-someone";
  open(key_);
  write_manifest("{");
  EXPECT_THROW(open(key_), std::runtime_error);
}

TEST_F(StageFolder, RemovesTornTemporaries) {
  open(key_);
  std::ofstream(folder_ / "unit-000000.h5.tmp") << "half";
  open(key_);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "unit-000000.h5.tmp"));
}

}  // namespace
}  // namespace q3d::pipeline::stages
