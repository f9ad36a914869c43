// The fidelity rule by hand-computed examples. The numbers are exact in binary, so boundaries are exact too.
#include "filters/fidelity.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <vector>

namespace q3d::filters {
namespace {

using manifests::Judgement;
using manifests::Reason;
using manifests::Verdict;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Thresholds make_thresholds() {
  Thresholds thresholds;
  thresholds.tau_low = 0.25;
  thresholds.tau_high = 0.75;
  thresholds.delta = 0.25;
  return thresholds;
}

TEST(Fidelity, BandsAreHalfOpen) {
  const Thresholds t = make_thresholds();
  EXPECT_EQ(band(0.0, t), Band::retain);
  EXPECT_EQ(band(std::nextafter(0.25, 0.0), t), Band::retain);
  EXPECT_EQ(band(0.25, t), Band::refine);
  EXPECT_EQ(band(std::nextafter(0.75, 0.0), t), Band::refine);
  EXPECT_EQ(band(0.75, t), Band::discard);
  EXPECT_EQ(band(kInfinity, t), Band::discard);
  EXPECT_EQ(band(kNan, t), Band::discard);
}

TEST(Fidelity, EqualThresholdsLeaveNoMiddleBand) {
  Thresholds t = make_thresholds();
  t.tau_high = t.tau_low;
  check(t);
  EXPECT_EQ(band(std::nextafter(0.25, 0.0), t), Band::retain);
  EXPECT_EQ(band(0.25, t), Band::discard);
}

TEST(Fidelity, IterationsGrowLinearlyAndRoundHalvesUp) {
  const Thresholds t = make_thresholds();
  EXPECT_EQ(adaptation_schedule(0.25, t).iterations, 10);
  EXPECT_EQ(adaptation_schedule(0.5, t).iterations, 35);
  EXPECT_EQ(adaptation_schedule(std::nextafter(0.75, 0.0), t).iterations, 60);
  // 10 + 50 (0.28125 - 0.25) / 0.5 = 13.125; with 0.2578125: 10.78125.
  EXPECT_EQ(adaptation_schedule(0.28125, t).iterations, 13);
  EXPECT_EQ(adaptation_schedule(0.2578125, t).iterations, 11);
  Thresholds short_range = t;
  short_range.iterations_max = 14;  // 10 + 4 * 0.125 = 10.5; 10 + 4 * 0.375 = 11.5
  EXPECT_EQ(adaptation_schedule(0.3125, short_range).iterations, 11);
  EXPECT_EQ(adaptation_schedule(0.4375, short_range).iterations, 12);
  EXPECT_THROW(adaptation_schedule(0.75, t), std::invalid_argument);
  EXPECT_THROW(adaptation_schedule(0.125, t), std::invalid_argument);
  EXPECT_THROW(adaptation_schedule(kNan, t), std::invalid_argument);
}

TEST(Fidelity, TauLowDoesNotEndAdaptation) {
  Thresholds t = make_thresholds();
  const adaptation::Schedule schedule = adaptation_schedule(0.5, t);
  EXPECT_EQ(schedule.stop_below, 0.0);
  EXPECT_EQ(schedule.min_gain, 0.25) << "delta";
  EXPECT_EQ(schedule.gain_window, 10);
  // Iterate 1 lies below tau_low = 0.25 already; 35 iterations are taken all the same.
  EXPECT_FALSE(adaptation::is_finished(schedule, std::vector{0.5, 0.125}, 1));
  t.stop_below = 0.25;
  EXPECT_TRUE(adaptation::is_finished(adaptation_schedule(0.5, t), std::vector{0.5, 0.125}, 1));
}

TEST(Fidelity, RetainedSamplesAreAdaptedOnRequestOnly) {
  Thresholds t = make_thresholds();
  EXPECT_FALSE(is_adapted(0.125, t));
  EXPECT_TRUE(is_adapted(0.25, t));
  EXPECT_FALSE(is_adapted(0.75, t));
  t.refine_retained = true;
  EXPECT_TRUE(is_adapted(0.125, t));
  EXPECT_TRUE(is_adapted(0.25, t));
  EXPECT_FALSE(is_adapted(0.75, t));
  EXPECT_FALSE(is_adapted(kNan, t));
  const adaptation::Schedule schedule = adaptation_schedule(0.125, t);
  EXPECT_EQ(schedule.iterations, 10);
  EXPECT_EQ(schedule.min_gain, 0.0) << "no test of the gain";
}

TEST(Fidelity, AnAdaptedRetainedSampleIsRefinedIfItBecameBetter) {
  Thresholds t = make_thresholds();
  t.refine_retained = true;
  const std::vector<double> better{0.125, 0.1171875, 0.12};  // a gain of 0.0625, below delta
  const Judgement refined = judge_retained(better, better, t);
  EXPECT_EQ(refined.verdict, Verdict::refined);
  EXPECT_EQ(refined.best_iteration, 1);
  EXPECT_EQ(refined.final_error, 0.1171875);
  EXPECT_EQ(refined.gain, 0.0625);
  const std::vector<double> worse{0.125, 0.15, 0.25};
  const Judgement retained = judge_retained(worse, worse, t);
  EXPECT_EQ(retained.verdict, Verdict::retained);
  EXPECT_EQ(retained.reason, Reason::none);
  EXPECT_EQ(retained.best_iteration, 0);
  EXPECT_EQ(retained.iterations, 2);
  EXPECT_EQ(retained.final_error, 0.125);
  const std::vector<double> held_out{0.5, 0.25, 0.75};
  EXPECT_EQ(judge_retained(better, held_out, t).best_iteration, 1);
  EXPECT_EQ(judge_retained(better, std::vector{0.5, 0.5, 0.75}, t).verdict, Verdict::retained);
  EXPECT_THROW(judge_retained(better, std::vector{0.5}, t), std::invalid_argument);
  EXPECT_EQ(judge_retained({}, {}, t).reason, Reason::prediction_not_finite);
}

TEST(Fidelity, RetainsBelowTauLow) {
  const Judgement judgement = judge_initial(0.125, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::retained);
  EXPECT_EQ(judgement.reason, Reason::none);
  EXPECT_EQ(judgement.detail, "");
  EXPECT_EQ(judgement.initial_error, 0.125);
  EXPECT_EQ(judgement.final_error, 0.125);
  EXPECT_TRUE(std::isnan(judgement.gain));
  EXPECT_EQ(judgement.iterations, 0);
  EXPECT_EQ(judgement.best_iteration, 0);
}

TEST(Fidelity, DiscardsFromTauHighOn) {
  const Judgement judgement = judge_initial(0.75, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::discarded);
  EXPECT_EQ(judgement.reason, Reason::error_too_large);
  EXPECT_THAT(judgement.detail, HasSubstr("0.75"));
  EXPECT_EQ(judgement.initial_error, 0.75);
}

TEST(Fidelity, AMiddleBandSampleWithoutAdaptationIsNotKept) {
  for (const double error : {0.25, 0.5}) {
    const Judgement judgement = judge_initial(error, make_thresholds());
    EXPECT_EQ(judgement.verdict, Verdict::discarded);
    EXPECT_EQ(judgement.reason, Reason::gain_too_small);
    EXPECT_TRUE(std::isnan(judgement.gain));
  }
}

TEST(Fidelity, FailsWithoutAFiniteError) {
  for (const double error : {kNan, kInfinity, -kInfinity}) {
    EXPECT_EQ(judge_initial(error, make_thresholds()).verdict, Verdict::failed);
    EXPECT_EQ(judge_initial(error, make_thresholds()).reason, Reason::prediction_not_finite);
    const std::vector<double> curve{error, 0.1};
    EXPECT_EQ(judge_adapted(curve, make_thresholds()).verdict, Verdict::failed);
    EXPECT_EQ(judge_adapted(curve, make_thresholds()).reason, Reason::prediction_not_finite);
  }
  EXPECT_EQ(judge_adapted({}, make_thresholds()).reason, Reason::prediction_not_finite);
}

TEST(Fidelity, AGainOfExactlyDeltaPasses) {
  // (0.5 - 0.375) / 0.5 = 0.25.
  const Judgement judgement = judge_adapted(std::vector{0.5, 0.4375, 0.375, 0.40625}, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::refined);
  EXPECT_EQ(judgement.reason, Reason::none);
  EXPECT_EQ(judgement.detail, "");
  EXPECT_EQ(judgement.initial_error, 0.5);
  EXPECT_EQ(judgement.final_error, 0.375);
  EXPECT_EQ(judgement.gain, 0.25);
  EXPECT_EQ(judgement.iterations, 3);
  EXPECT_EQ(judgement.best_iteration, 2);
}

TEST(Fidelity, AGainJustBelowDeltaDiscards) {
  const Judgement judgement = judge_adapted(std::vector{0.5, std::nextafter(0.375, 1.0)}, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::discarded);
  EXPECT_EQ(judgement.reason, Reason::gain_too_small);
  EXPECT_LT(judgement.gain, 0.25);
  EXPECT_EQ(judgement.iterations, 1);
}

TEST(Fidelity, TheGainIsMeasuredWithinTheWindowOnly) {
  std::vector<double> curve(13, 0.5);
  curve[11] = 0.3125;  // iterate 11 would be gain enough, but comes late
  const Judgement late = judge_adapted(curve, make_thresholds());
  EXPECT_EQ(late.verdict, Verdict::discarded);
  EXPECT_EQ(late.gain, 0.0);
  EXPECT_EQ(late.best_iteration, 11);
  EXPECT_EQ(late.final_error, 0.3125);

  curve[10] = 0.375;  // iterate 10 is the last of the window
  const Judgement in_time = judge_adapted(curve, make_thresholds());
  EXPECT_EQ(in_time.verdict, Verdict::refined);
  EXPECT_EQ(in_time.gain, 0.25);
  EXPECT_EQ(in_time.best_iteration, 11) << "the kept iterate may lie beyond the window";
}

TEST(Fidelity, ASmallGainDiscardsBelowTauLowToo) {
  // The error falls from 0.28125 to just below 0.25, which is a gain of 0.11.
  const double below = std::nextafter(0.25, 0.0);
  const Judgement judgement = judge_adapted(std::vector{0.28125, below, 0.3}, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::discarded);
  EXPECT_EQ(judgement.reason, Reason::gain_too_small);
  EXPECT_EQ(judgement.final_error, below);
}

TEST(Fidelity, AnEarlyEndBelowStopBelowSkipsTheTestOfTheGain) {
  Thresholds t = make_thresholds();
  t.stop_below = 0.25;
  const double below = std::nextafter(0.25, 0.0);
  const Judgement early = judge_adapted(std::vector{0.28125, below}, t);
  EXPECT_EQ(early.verdict, Verdict::refined);
  EXPECT_LT(early.gain, 0.25);
  EXPECT_EQ(judge_adapted(std::vector{0.28125, 0.25}, t).verdict, Verdict::discarded)
      << "stop_below itself is not below";
  std::vector<double> late(13, 0.28125);
  late[12] = below;
  EXPECT_EQ(judge_adapted(late, t).verdict, Verdict::discarded) << "after the window the gain was asked for";
}

TEST(Fidelity, TheBestIterateMayBeThePredictionAndTheFirstOfEqualOnesCounts) {
  const Judgement rising = judge_adapted(std::vector{0.5, 0.625, 0.5625}, make_thresholds());
  EXPECT_EQ(rising.verdict, Verdict::discarded);
  EXPECT_EQ(rising.best_iteration, 0);
  EXPECT_EQ(rising.final_error, 0.5);
  EXPECT_EQ(rising.gain, -0.125);
  EXPECT_EQ(judge_adapted(std::vector{0.5, 0.25, 0.25}, make_thresholds()).best_iteration, 1);
}

TEST(Fidelity, PassesOverIteratesThatAreNotFinite) {
  const Judgement judgement =
      judge_adapted(std::vector{0.5, kNan, 0.25, -kInfinity, kNan}, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::refined);
  EXPECT_EQ(judgement.gain, 0.5);
  EXPECT_EQ(judgement.best_iteration, 2);
  EXPECT_EQ(judgement.iterations, 4);
  const Judgement diverged = judge_adapted(std::vector{0.5, kNan, kNan}, make_thresholds());
  EXPECT_EQ(diverged.verdict, Verdict::discarded);
  EXPECT_EQ(diverged.reason, Reason::gain_too_small);
  EXPECT_TRUE(std::isnan(diverged.gain));
  EXPECT_EQ(diverged.best_iteration, 0);
}

TEST(Fidelity, ACurveOfThePredictionAloneHasNoGain) {
  const Judgement judgement = judge_adapted(std::vector{0.5}, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::discarded);
  EXPECT_TRUE(std::isnan(judgement.gain));
  EXPECT_EQ(judgement.iterations, 0);
}

TEST(Fidelity, DeltaZeroKeepsWhatDoesNotGetWorse) {
  Thresholds t = make_thresholds();
  t.delta = 0.0;
  EXPECT_EQ(judge_adapted(std::vector{0.5, 0.5}, t).verdict, Verdict::refined);
  EXPECT_EQ(judge_adapted(std::vector{0.5, 0.625}, t).verdict, Verdict::discarded);
}

TEST(Fidelity, ChecksThresholdsOneByOne) {
  EXPECT_NO_THROW(check(make_thresholds()));
  const auto expect_refused = [](auto change, const std::string& rule) {
    Thresholds bad = make_thresholds();
    change(bad);
    EXPECT_THAT([&] { check(bad); }, ThrowsMessage<std::invalid_argument>(HasSubstr(rule)));
  };
  expect_refused([](auto& t) { t.tau_low = 0.0; }, "0 < tau_low");
  expect_refused([](auto& t) { t.tau_low = kNan; }, "0 < tau_low");
  expect_refused([](auto& t) { t.tau_high = 0.2; }, "tau_low <= tau_high");
  expect_refused([](auto& t) { t.tau_high = kNan; }, "tau_low <= tau_high");
  expect_refused([](auto& t) { t.delta = 1.0; }, "0 <= delta < 1");
  expect_refused([](auto& t) { t.delta = -0.01; }, "0 <= delta < 1");
  expect_refused([](auto& t) { t.gain_window = 0; }, "gain_window >= 1");
  expect_refused([](auto& t) { t.iterations_min = 0; }, "iterations_min >= 1");
  expect_refused([](auto& t) { t.iterations_max = 9; }, "iterations_min <= iterations_max");
  expect_refused([](auto& t) { t.stop_below = -0.1; }, "0 <= stop_below");
  expect_refused([](auto& t) { t.stop_below = 0.26; }, "stop_below <= tau_low");
}

}  // namespace
}  // namespace q3d::filters
