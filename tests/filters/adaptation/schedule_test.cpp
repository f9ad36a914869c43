// These tests check by hand-made curves when adaptation ends. The numbers are exact in binary, so boundaries
// are exact too.
#include "filters/adaptation/schedule.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace q3d::filters::adaptation {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Returns the number of iterations after which an adaptation with this curve ends. The curve must be long
// enough.
int end_of(const Schedule& schedule, const std::vector<double>& curve) {
  int best = 0;
  for (std::size_t taken = 0; taken < curve.size(); ++taken) {
    if (curve[taken] < curve[static_cast<std::size_t>(best)]) best = static_cast<int>(taken);
    if (is_finished(schedule, std::span(curve).first(taken + 1), best)) return static_cast<int>(taken);
  }
  ADD_FAILURE() << "the curve is too short";
  return -1;
}

const std::vector<double> kFalling{0.5, 0.4375, 0.375, 0.3125, 0.25, 0.1875, 0.125};

TEST(Schedule, TakesAllIterationsUnlessItIsToldToEnd) {
  Schedule schedule;
  schedule.iterations = 6;
  EXPECT_EQ(end_of(schedule, kFalling), 6);
  schedule.iterations = 0;
  EXPECT_EQ(end_of(schedule, kFalling), 0);
}

TEST(Schedule, EndsAtTheFirstIterateBelowTheBound) {
  Schedule schedule;
  schedule.iterations = 6;
  schedule.stop_below = 0.3125;
  EXPECT_EQ(end_of(schedule, kFalling), 4) << "0.3125 itself is not below";
  schedule.stop_below = 0.75;
  EXPECT_EQ(end_of(schedule, kFalling), 0) << "the prediction is below";
}

TEST(Schedule, EndsAfterTheWindowWithoutTheGain) {
  Schedule schedule;
  schedule.iterations = 6;
  schedule.gain_window = 2;
  schedule.min_gain = 0.25;  // (0.5 - 0.375) / 0.5
  EXPECT_EQ(end_of(schedule, kFalling), 6) << "a gain of exactly the least is enough";
  schedule.min_gain = 0.2501;
  EXPECT_EQ(end_of(schedule, kFalling), 2);
}

TEST(Schedule, PatienceNeedsHeldOutKeypoints) {
  Schedule schedule;
  schedule.iterations = 6;
  schedule.patience = 2;
  const std::vector<double> flat(7, 0.5);
  EXPECT_EQ(end_of(schedule, flat), 6);
  schedule.held_out[25] = true;
  EXPECT_TRUE(holds_out(schedule));
  EXPECT_EQ(end_of(schedule, flat), 2);
}

TEST(RelativeGain, IsOfTheBestIterateWithinTheWindow) {
  EXPECT_EQ(relative_gain(std::vector{0.5, 0.375, 0.4375}, 10), 0.25);
  EXPECT_EQ(relative_gain(std::vector{0.5, 0.4375, 0.25}, 1), 0.125) << "iterate 2 lies beyond the window";
  EXPECT_EQ(relative_gain(std::vector{0.5, 0.625}, 10), -0.25);
  EXPECT_EQ(relative_gain(std::vector{0.0, 0.0}, 10), 0.0);
  EXPECT_EQ(relative_gain(std::vector{0.5, kNan, 0.25}, 10), 0.5);
  EXPECT_TRUE(std::isnan(relative_gain(std::vector{0.5}, 10)));
  EXPECT_TRUE(std::isnan(relative_gain(std::vector{0.5, kNan}, 10)));
  EXPECT_THROW(relative_gain({}, 10), std::invalid_argument);
}

TEST(Schedule, FieldsOutOfRangeAreRefused) {
  const auto expect_refused = [](auto change, const std::string& name) {
    Schedule schedule;
    EXPECT_NO_THROW(check(schedule));
    change(schedule);
    EXPECT_THAT([&] { check(schedule); }, ThrowsMessage<std::invalid_argument>(HasSubstr(name)));
  };
  expect_refused([](auto& s) { s.iterations = -1; }, "iterations is -1");
  expect_refused([](auto& s) { s.gain_window = 0; }, "gain_window is 0");
  expect_refused([](auto& s) { s.patience = -1; }, "patience is -1");
}

}  // namespace
}  // namespace q3d::filters::adaptation
