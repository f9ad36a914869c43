#include "pipeline/report/overlay_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::report {
namespace {

using manifests::Reason;
using manifests::Verdict;
using testing::ElementsAre;

dataset::VerdictRow row(const std::string& id, Verdict verdict, double initial, double final,
                        const std::string& species, Reason reason = Reason::none) {
  dataset::VerdictRow result;
  result.id = id;
  result.dataset = id.substr(0, id.find('/'));
  result.species = species;
  result.family = species == "lion" ? manifests::Family::felidae : manifests::Family::canidae;
  result.judgement.verdict = verdict;
  result.judgement.reason = reason;
  result.judgement.initial_error = initial;
  result.judgement.final_error = final;
  return result;
}

// tau_low 0.04 and tau_high 0.08 in zoo, 0.02 and 0.1 in farm.
const ThresholdsByDataset kThresholds{{"zoo", {.tau_low = 0.04, .tau_high = 0.08}},
                                      {"farm", {.tau_low = 0.02, .tau_high = 0.1}}};

std::vector<dataset::VerdictRow> rows() {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  return {row("zoo/a.jpg#0", Verdict::retained, 0.03, 0.03, "lion"),
          row("zoo/b.jpg#1", Verdict::refined, 0.079, 0.05, "wolf"),
          row("zoo/c.jpg#2", Verdict::discarded, 0.3, 0.3, "lion", Reason::error_too_large),
          row("zoo/d.jpg#3", Verdict::failed, kNaN, kNaN, "", Reason::image_missing),
          row("farm/a.jpg#4", Verdict::discarded, 0.05, 0.049, "wolf", Reason::gain_too_small),
          row("farm/aa.jpg#5", Verdict::retained, 0.018, 0.018, "wolf")};
}

std::vector<std::string> ids(const Choice& choice) {
  std::vector<std::string> found;
  for (const dataset::VerdictRow& each : choose(rows(), kThresholds, choice)) found.push_back(each.id);
  return found;
}

TEST(Choose, OrdersByErrorAndLeavesOutWhatHasNone) {
  EXPECT_THAT(ids({.order = Order::worst, .count = 2}), ElementsAre("zoo/c.jpg#2", "zoo/b.jpg#1"));
  EXPECT_THAT(ids({.order = Order::best, .count = 2}), ElementsAre("farm/aa.jpg#5", "zoo/a.jpg#0"));
  EXPECT_EQ(ids({.order = Order::best, .count = 100}).size(), 5U) << "the failed one has no error";
}

TEST(Choose, MeasuresTheDistanceByTheDatasetsOwnThresholds) {
  // 0.001 to tau_high, 0.002 to farm's tau_low, 0.01 to tau_low.
  EXPECT_THAT(ids({.order = Order::near_threshold, .count = 3}),
              ElementsAre("zoo/b.jpg#1", "farm/aa.jpg#5", "zoo/a.jpg#0"));
}

TEST(Choose, FiltersBySpeciesFamilyDatasetAndVerdictOrReason) {
  EXPECT_THAT(ids({.species = {"lion"}}), ElementsAre("zoo/a.jpg#0", "zoo/c.jpg#2"));
  EXPECT_THAT(ids({.families = {"felidae"}}), ElementsAre("zoo/a.jpg#0", "zoo/c.jpg#2"));
  EXPECT_THAT(ids({.datasets = {"farm"}}), ElementsAre("farm/a.jpg#4", "farm/aa.jpg#5"));
  EXPECT_THAT(ids({.verdicts = {"refined", "image_missing"}}), ElementsAre("zoo/b.jpg#1", "zoo/d.jpg#3"));
}

TEST(Choose, TakesAWholeIdOrAllThatHoldAPart) {
  EXPECT_THAT(ids({.ids = {"c.jpg", "zoo/a.jpg#0"}}), ElementsAre("zoo/c.jpg#2", "zoo/a.jpg#0"));
  EXPECT_THAT(ids({.ids = {"farm"}}), ElementsAre("farm/a.jpg#4", "farm/aa.jpg#5"));
  EXPECT_THAT(ids({.ids = {"a.jpg", "farm"}}), ElementsAre("zoo/a.jpg#0", "farm/a.jpg#4", "farm/aa.jpg#5"))
      << "each once";
  EXPECT_THROW(ids({.ids = {"tiger"}}), std::runtime_error);
}

TEST(Choose, SpreadsOverTheDataset) {
  EXPECT_THAT(ids({.count = 3}), ElementsAre("zoo/a.jpg#0", "zoo/c.jpg#2", "farm/a.jpg#4"));
  EXPECT_EQ(ids({.count = 100}).size(), 6U);
}

TEST(Choose, RefusesNamesThatDoNotExist) {
  EXPECT_THROW(ids({.verdicts = {"kept"}}), run::ConfigError);
  EXPECT_THROW(ids({.families = {"birds"}}), run::ConfigError);
}

}  // namespace
}  // namespace q3d::pipeline::report
