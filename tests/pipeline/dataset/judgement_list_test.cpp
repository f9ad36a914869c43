#include "pipeline/dataset/judgement_list.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "tests/support/paths.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::Judgement;
using manifests::Reason;
using manifests::Verdict;

// Every member differs from its default and from those of another number.
Judgement judgement(int number) {
  Judgement made;
  made.verdict = number % 2 == 0 ? Verdict::refined : Verdict::discarded;
  made.reason = number % 2 == 0 ? Reason::none : Reason::error_too_large;
  made.detail = "remark " + std::to_string(number);
  made.initial_error = 0.5 + number;
  made.final_error = 0.25 + number;
  made.gain = 0.125 * number;
  made.iterations = 10 + number;
  made.best_iteration = 5 + number;
  made.trust.mirror = 0.0625 * number;
  return made;
}

void expect_equal(const Judgement& got, const Judgement& expected) {
  EXPECT_EQ(got.verdict, expected.verdict);
  EXPECT_EQ(got.reason, expected.reason);
  EXPECT_EQ(got.detail, expected.detail);
  EXPECT_EQ(got.initial_error, expected.initial_error);
  EXPECT_EQ(got.final_error, expected.final_error);
  EXPECT_EQ(got.gain, expected.gain);
  EXPECT_EQ(got.iterations, expected.iterations);
  EXPECT_EQ(got.best_iteration, expected.best_iteration);
  EXPECT_EQ(got.trust.mirror, expected.trust.mirror);
}

class JudgementListTest : public ::testing::Test {
 protected:
  q3d::testing::ScratchDir scratch_;
  JudgementList list_{scratch_.path(), 3};
};

TEST_F(JudgementListTest, GivesTheVerdictsOfAUnitInWhateverOrderTheUnitsCame) {
  list_.set(2, std::vector{judgement(4)});
  list_.set(0, std::vector{judgement(1), judgement(2), judgement(3)});
  list_.set(1, std::vector<Judgement>{});
  ASSERT_EQ(list_.of(0).size(), 3U);
  for (int i = 0; i < 3; ++i) expect_equal(list_.of(0)[static_cast<std::size_t>(i)], judgement(1 + i));
  EXPECT_TRUE(list_.of(1).empty());
  ASSERT_EQ(list_.of(2).size(), 1U);
  expect_equal(list_.of(2)[0], judgement(4));
}

TEST_F(JudgementListTest, KeepsTheLastVerdictsOfAUnit) {
  list_.set(0, std::vector{judgement(1), judgement(2)});
  list_.set(0, std::vector{judgement(7)});
  ASSERT_EQ(list_.of(0).size(), 1U);
  expect_equal(list_.of(0)[0], judgement(7));
}

TEST_F(JudgementListTest, KnowsWhichUnitsHaveNone) {
  list_.set(1, std::vector{judgement(1)});
  EXPECT_FALSE(list_.has(0));
  EXPECT_TRUE(list_.has(1));
  EXPECT_EQ(list_.units(), 3U);
  EXPECT_THROW(list_.of(0), std::logic_error);
  EXPECT_THROW(list_.set(3, std::vector{judgement(1)}), std::out_of_range);
}

TEST_F(JudgementListTest, KeepsWhatWasNotMeasured) {
  list_.set(0, std::vector{Judgement{}});
  EXPECT_TRUE(std::isnan(list_.of(0)[0].initial_error));
  EXPECT_TRUE(std::isnan(list_.of(0)[0].gain));
}

TEST_F(JudgementListTest, LeavesNoFileWithANameBehind) {
  list_.set(0, std::vector{judgement(1)});
  EXPECT_TRUE(std::filesystem::is_empty(scratch_.path()));
}

}  // namespace
}  // namespace q3d::pipeline::dataset
