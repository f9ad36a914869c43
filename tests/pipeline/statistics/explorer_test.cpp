#include "pipeline/statistics/explorer.h"

#include <gtest/gtest.h>

#include "tests/pipeline/statistics/made_facts.h"

namespace q3d::pipeline::statistics {
namespace {

using manifests::Reason;
using manifests::Verdict;
using nlohmann::ordered_json;

ordered_json document(const ordered_json& guards = nullptr) {
  return {{"guards", guards}, {"provenance", {{"config", {{"tta", {{"iterations_min", 12}}}}}}}};
}

dataset::DatasetManifest manifest() {
  dataset::DatasetManifest result;
  result.thresholds["zoo"] = {.tau_low = 0.03, .tau_high = 0.08, .delta = 0.05};
  return result;
}

Facts facts() {
  Facts result;
  result.candidates = {
      candidate({.initial_error = 0.1234567890123456789}),
      candidate({.verdict = Verdict::refined,
                 .initial_error = 0.05,
                 .final_error = 0.03,
                 .gain = 0.25,
                 .iterations = 36}),
      candidate({.verdict = Verdict::discarded, .reason = Reason::vetoed}),
      candidate({.species = "cow",
                 .verdict = Verdict::failed,
                 .reason = Reason::image_missing,
                 .initial_error = std::numeric_limits<double>::quiet_NaN()}),
      candidate({.species = "cow"}),
  };
  result.candidates[4].role = config::Role::truth;
  return result;
}

TEST(Explorer, HasTheJudgedCandidatesToTheLastDigit) {
  const auto result = explorer(facts(), manifest(), document());
  EXPECT_EQ(result["error"].size(), 3U);
  EXPECT_EQ(result["error"][0].get<double>(), 0.1234567890123456789);
  EXPECT_EQ(ordered_json::parse(result.dump())["error"][0].get<double>(), 0.1234567890123456789)
      << "a threshold may lie between two neighbours";
  EXPECT_TRUE(result["gain"][0].is_null()) << "it was not adapted";
  EXPECT_EQ(result["gain"][1], 0.25);
  EXPECT_EQ(result["iterations"][1], 36);
  EXPECT_EQ(result["fixed"], (ordered_json{0, 0, 1}));
  EXPECT_EQ(result["rule"]["iterations_min"], 12);
  EXPECT_EQ(result["rule"]["iterations_max"], 60);
  EXPECT_EQ(result["thresholds"]["zoo"]["tau_high"], 0.08);
}

TEST(Explorer, CountsTheOthersBySpecies) {
  const auto result = explorer(facts(), manifest(), document());
  EXPECT_EQ(result["others"], (ordered_json{{"cow", {2, 1}}})) << "one failed, one brings its label";
}

TEST(Explorer, SaysWhetherAGuardIsOn) {
  EXPECT_EQ(explorer(facts(), manifest(), document())["rule"]["guarded"], false);
  EXPECT_EQ(explorer(facts(), manifest(),
                     document({{"held_out_share", 0.0}, {"held_out_seed", 3}}))["rule"]["guarded"],
            false);
  EXPECT_EQ(explorer(facts(), manifest(), document({{"held_out_share", 0.3}}))["rule"]["guarded"], true);
}

TEST(Explorer, IsNullWithoutPredictions) {
  Facts none = facts();
  none.candidates.erase(none.candidates.begin(), none.candidates.begin() + 3);
  EXPECT_TRUE(explorer(none, manifest(), document()).is_null());
}

}  // namespace
}  // namespace q3d::pipeline::statistics
