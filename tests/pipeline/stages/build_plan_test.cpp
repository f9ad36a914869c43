#include "pipeline/stages/build_plan.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include <fstream>
#include <functional>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/stages/made_from.h"
#include "pipeline/stages/plan_difference.h"
#include "pipeline/stages/stage.h"
#include "tests/support/paths.h"
#include "tests/support/told.h"

namespace q3d::pipeline::stages {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Inputs {
  config::BuildConfig config;
  config::JudgingRules rules;
  candidates::Ingest ingest;
  AssetDigests assets{std::string(64, 'c'), std::string(64, 'a'), ""};
  std::string device = "cpu-2";

  Inputs() {
    config.name = "made";
    config::DatasetConfig& dataset = config.datasets.emplace_back();
    dataset.name = "a";
    dataset.format = "prima";
    dataset.split = "train";
    ingest.annotation_digests["a/train"] = "digest";
    ingest.candidates.append(std::vector<candidates::Candidate>(3));
    ingest.units = {{0, 0, 2, "first", "first"}, {1, 2, 1, "second", "second without one"}};
    limits().tau_low = 0.125;
    limits().tau_high = 0.25;
  }
  filters::Thresholds& limits() { return rules.thresholds["a"]; }
  BuildPlan plan() const {
    return plan_of(config, rules, ingest, assets, device, {"build", "--out", "my out"});
  }
};

BuildPlan changed(const std::function<void(Inputs&)>& change) {
  Inputs inputs;
  change(inputs);
  return inputs.plan();
}

TEST(MadeFrom, EveryKeyIsTheDigestOfItsText) {
  const Inputs inputs;
  const BuildPlan plan = inputs.plan();
  const StageKeys keys = stage_keys(inputs.config, inputs.rules, inputs.ingest, inputs.assets, inputs.device);
  for (const Stage stage : kStages) {
    const std::string name(to_string(stage));
    EXPECT_EQ(manifests::sha256(plan.made_from.at(name)), key_of(keys, stage)) << name;
    EXPECT_EQ(stage_from_string(name), stage);
  }
}

TEST(BuildPlan, WritesBytesOfItsCommandThatAreNoUtf8Out) {
  const testing::ScratchDir scratch;
  BuildPlan plan = Inputs().plan();
  plan.command = {"build", "--out", "caf\xe9"};
  write_build_plan(scratch.path(), plan);
  EXPECT_THAT(read_build_plans(scratch.path()).at(0).command, ElementsAre("build", "--out", "caf\\xe9"));
}

TEST(BuildPlan, ComesBackFromItsFile) {
  const testing::ScratchDir scratch;
  const BuildPlan plan = Inputs().plan();
  write_build_plan(scratch.path(), plan);
  const std::vector<BuildPlan> found = read_build_plans(scratch.path());
  ASSERT_EQ(found.size(), 1U);
  const BuildPlan& read = found[0];
  EXPECT_EQ(read.name, "made");
  EXPECT_EQ(read.candidates, 3);
  EXPECT_EQ(read.keys.dataset, plan.keys.dataset);
  for (const Stage stage : kStages) EXPECT_EQ(key_of(read.keys, stage), key_of(plan.keys, stage));
  EXPECT_EQ(read.made_from, plan.made_from);
  EXPECT_THAT(read.command, ElementsAre("build", "--out", "my out"));
  ASSERT_EQ(read.units.size(), 2U);
  EXPECT_EQ(read.units[1].input_digest, "second");
  EXPECT_EQ(read.units[1].label_digest, "second without one");
  EXPECT_EQ(version_name(read.name, read.keys), "made-" + plan.keys.dataset.substr(0, 12));
}

TEST(BuildPlan, ADamagedFileIsToldAndLeftOut) {
  const testing::ScratchDir scratch;
  const BuildPlan plan = Inputs().plan();
  write_build_plan(scratch.path(), plan);
  const std::filesystem::path file = plan_file(scratch.path(), version_name(plan.name, plan.keys));
  const std::string sound = manifests::read_file(file);
  nlohmann::json without = nlohmann::json::parse(sound);
  without.erase("units");
  for (const std::string& text : {sound.substr(0, 99), without.dump(), std::string("[]"), std::string()}) {
    manifests::write_file_atomically(file, text);
    const testing::Told told;
    EXPECT_THAT(read_build_plans(scratch.path()), IsEmpty()) << text;
    EXPECT_THAT(told.warnings, ElementsAre(HasSubstr(file.string() + ": damaged"))) << text;
  }
  EXPECT_THAT(read_build_plans(scratch.path() / "nowhere"), IsEmpty());
}

TEST(BuildPlan, EveryFlippedBitIsFound) {
  const testing::ScratchDir scratch;
  const BuildPlan plan = Inputs().plan();
  write_build_plan(scratch.path(), plan);
  EXPECT_THAT(find_damaged_plans(scratch.path()), IsEmpty());
  const std::filesystem::path file = plan_file(scratch.path(), version_name(plan.name, plan.keys));
  const std::string sound = manifests::read_file(file);
  for (std::size_t at = 0; at < sound.size(); ++at) {
    std::string damaged = sound;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << (at % 8)));
    std::ofstream(file, std::ios::binary) << damaged;
    const std::vector<DamagedPlan> found = find_damaged_plans(scratch.path());
    ASSERT_EQ(found.size(), 1U) << "byte " << at;
    EXPECT_EQ(found[0].file, file);
  }
}

TEST(BuildPlan, APlanOfAnEarlierVersionHasNoDigest) {
  const testing::ScratchDir scratch;
  const BuildPlan plan = Inputs().plan();
  write_build_plan(scratch.path(), plan);
  const std::filesystem::path file = plan_file(scratch.path(), version_name(plan.name, plan.keys));
  nlohmann::ordered_json document = nlohmann::ordered_json::parse(manifests::read_file(file));
  document.erase("digest");
  manifests::write_file_atomically(file, document.dump(2) + "\n");
  EXPECT_THAT(find_damaged_plans(scratch.path()), IsEmpty());
  EXPECT_EQ(read_build_plans(scratch.path()).size(), 1U);
}

TEST(PlanDifference, NamesWhatAKeyWasMadeFrom) {
  const BuildPlan before = Inputs().plan();
  EXPECT_THAT(differences(before, before, Stage::shards), IsEmpty());
  const BuildPlan batch = changed([](Inputs& inputs) { inputs.config.network.batch = 3; });
  EXPECT_THAT(differences(before, batch, Stage::predict), ElementsAre("batch: 8 -> 3"));
  const BuildPlan device = changed([](Inputs& inputs) { inputs.device = "cuda"; });
  EXPECT_THAT(differences(before, device, Stage::predict), ElementsAre("device: cpu-2 -> cuda"));
  const BuildPlan weights = changed([](Inputs& inputs) { inputs.assets.checkpoint = std::string(64, 'd'); });
  EXPECT_THAT(differences(before, weights, Stage::predict),
              ElementsAre("checkpoint: cccccccccccc -> dddddddddddd"));
}

TEST(PlanDifference, NamesTheStageBeforeAndTheThresholdsOfTheOneWithoutAFolder) {
  const BuildPlan before = Inputs().plan();
  const BuildPlan batch = changed([](Inputs& inputs) { inputs.config.network.batch = 3; });
  EXPECT_THAT(differences(before, batch, Stage::refine),
              ElementsAre("the stage predict before it is another"));
  const BuildPlan tau = changed([](Inputs& inputs) { inputs.limits().tau_low = 0.0625; });
  EXPECT_THAT(differences(before, tau, Stage::predict), IsEmpty());
  EXPECT_THAT(differences(before, tau, Stage::refine), ElementsAre("tau_low: 0.125 -> 0.0625"));
  EXPECT_THAT(differences(before, tau, Stage::measure), ElementsAre("the stage refine before it is another"));
}

TEST(PlanDifference, TheNearestPlanIsTheOneThatDiffersLeastThenThePreferred) {
  const BuildPlan wanted = Inputs().plan();
  const BuildPlan one = changed([](Inputs& inputs) { inputs.config.network.batch = 3; });
  const BuildPlan other = changed([](Inputs& inputs) { inputs.device = "cuda"; });
  const BuildPlan far = changed([](Inputs& inputs) {
    inputs.config.network.batch = 3;
    inputs.device = "cuda";
  });
  const auto nearest = [&](const std::vector<BuildPlan>& plans, const BuildPlan& preferred) {
    return nearest_plan(plans, wanted, Stage::predict, version_name("made", preferred.keys))->keys.dataset;
  };
  EXPECT_EQ(nearest({one, far}, far), one.keys.dataset);
  EXPECT_EQ(nearest({one, other}, one), one.keys.dataset);
  EXPECT_EQ(nearest({one, other}, other), other.keys.dataset);
  EXPECT_FALSE(nearest_plan({}, wanted, Stage::predict, ""));
}

}  // namespace
}  // namespace q3d::pipeline::stages
