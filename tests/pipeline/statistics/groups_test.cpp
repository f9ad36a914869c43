#include "pipeline/statistics/groups.h"

#include <gtest/gtest.h>

#include "tests/pipeline/statistics/made_facts.h"

namespace q3d::pipeline::statistics {
namespace {

using manifests::Family;
using manifests::Reason;
using manifests::Verdict;

// Four lions of which two are kept, two cows of which one is, a wolf that is lost, and one that is unknown.
Facts zoo() {
  Facts facts;
  facts.candidates = {
      candidate({.initial_error = 0.02, .final_error = 0.02}),
      candidate({.verdict = Verdict::refined,
                 .initial_error = 0.06,
                 .final_error = 0.04,
                 .gain = 0.2,
                 .iterations = 30}),
      candidate({.verdict = Verdict::discarded, .reason = Reason::error_too_large, .initial_error = 0.2}),
      candidate({.verdict = Verdict::discarded, .reason = Reason::gain_too_small, .initial_error = 0.06}),
      candidate({.species = "cow", .family = Family::bovidae}),
      candidate({.species = "cow",
                 .family = Family::bovidae,
                 .verdict = Verdict::discarded,
                 .reason = Reason::vetoed}),
      candidate({.species = "wolf",
                 .family = Family::canidae,
                 .verdict = Verdict::discarded,
                 .reason = Reason::error_too_large}),
      candidate({.species = "",
                 .family = Family::none,
                 .verdict = Verdict::failed,
                 .reason = Reason::image_missing}),
  };
  return facts;
}

TEST(Funnel, CountsWhatIsLeftAfterEachStep) {
  const auto steps = funnel(zoo());
  std::vector<std::pair<std::string, int>> counts;
  for (const auto& step : steps) counts.emplace_back(step["step"], step["count"]);
  EXPECT_EQ(counts, (std::vector<std::pair<std::string, int>>{
                        {"candidates", 8}, {"usable", 7}, {"admitted", 6}, {"near enough", 4}, {"kept", 3}}));
}

TEST(Reasons, AreCountedLargestFirst) {
  const auto list = reasons(zoo());
  ASSERT_EQ(list.size(), 4U);
  EXPECT_EQ(list[0]["reason"], "error_too_large");
  EXPECT_EQ(list[0]["count"], 2);
  EXPECT_EQ(list[0]["verdict"], "discarded");
  EXPECT_FALSE(list[0]["meaning"].get<std::string>().empty());
}

TEST(Groups, HaveCountsSharesAndYields) {
  const auto all = groups(zoo());
  const auto& lion = all["species"][0];
  EXPECT_EQ(lion["name"], "lion");
  EXPECT_EQ(lion["family"], "felidae");
  EXPECT_EQ(lion["candidates"], 4);
  EXPECT_EQ(lion["kept"], 2);
  EXPECT_DOUBLE_EQ(lion["yield"]["share"].get<double>(), 0.5);
  EXPECT_DOUBLE_EQ(lion["share_before"].get<double>(), 0.5);
  EXPECT_NEAR(lion["share_after"].get<double>(), 2.0 / 3.0, 1e-5);
  EXPECT_DOUBLE_EQ(lion["mean_error_before"].get<double>(), 0.04);
  EXPECT_DOUBLE_EQ(lion["mean_error_after"].get<double>(), 0.03);
  EXPECT_EQ(all["species"].back()["name"], "wolf") << "of equal size, by name";
}

TEST(Groups, TheImbalanceLeavesOutUnknownsAndCountsTheLost) {
  const auto species = groups(zoo())["imbalance"]["species"];
  EXPECT_EQ(species["before"]["ratio"], 4.0) << "4 lions, 1 wolf";
  EXPECT_EQ(species["before"]["lost"], 0);
  EXPECT_EQ(species["after"]["ratio"], 2.0) << "2 lions, 1 cow";
  EXPECT_EQ(species["after"]["lost"], 1) << "the wolf";
}

}  // namespace
}  // namespace q3d::pipeline::statistics
