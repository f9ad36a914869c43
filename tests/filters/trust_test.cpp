#include "filters/trust.h"

#include <gtest/gtest.h>

#include <cmath>

namespace q3d::filters {
namespace {

using manifests::Judgement;
using manifests::Verdict;

// A label whose scores all have the mean that they had in the world of the fit.
Judgement average(Verdict verdict) {
  Judgement judgement;
  judgement.verdict = verdict;
  judgement.initial_error = std::exp(verdict == Verdict::retained ? -3.194 : -3.019);
  judgement.gain = 0.5484;
  judgement.trust.aux_2d = std::exp(-3.628);
  judgement.trust.visible = 15.93;
  return judgement;
}

// The chance for these log odds.
double logistic(double odds) {
  return 1.0 / (1.0 + std::exp(-odds));
}

TEST(Trust, AnAverageLabelHasTheBias) {
  EXPECT_NEAR(combined_trust(average(Verdict::retained)), logistic(0.8644), 1e-12);
  EXPECT_NEAR(combined_trust(average(Verdict::refined)), logistic(2.326), 1e-12);
}

// One deviation more of one score changes the log odds by its weight.
TEST(Trust, EveryScoreHasItsWeight) {
  Judgement label = average(Verdict::refined);
  label.initial_error *= std::exp(0.2479);
  EXPECT_NEAR(combined_trust(label), logistic(2.326 - 0.6541), 1e-9);
  label = average(Verdict::refined);
  label.trust.aux_2d *= std::exp(0.3163);
  EXPECT_NEAR(combined_trust(label), logistic(2.326 - 0.4351), 1e-9);
  label = average(Verdict::refined);
  label.gain += 0.111;
  EXPECT_NEAR(combined_trust(label), logistic(2.326 + 0.4298), 1e-9);
  label = average(Verdict::refined);
  label.trust.visible += 3.491;
  EXPECT_NEAR(combined_trust(label), logistic(2.326 + 0.3728), 1e-9);
}

TEST(Trust, ARetainedLabelIsTrustedByItsErrorAlone) {
  Judgement label = average(Verdict::retained);
  label.initial_error *= std::exp(0.1875);
  EXPECT_NEAR(combined_trust(label), logistic(0.8644 - 0.6935), 1e-9);
  label.trust.aux_2d = 1.0;
  EXPECT_NEAR(combined_trust(label), logistic(0.8644 - 0.6935), 1e-9);
}

TEST(Trust, WhatIsNotMeasuredCountsAsAverage) {
  Judgement label = average(Verdict::refined);
  label.trust.aux_2d = std::nan("");
  label.gain = std::nan("");
  EXPECT_NEAR(combined_trust(label), logistic(2.326), 1e-12);
}

TEST(Trust, ThereIsNoneWithoutALabelOrAMeasurement) {
  EXPECT_TRUE(std::isnan(combined_trust(average(Verdict::discarded))));
  Judgement label = average(Verdict::refined);
  label.trust.visible = std::nan("");
  EXPECT_TRUE(std::isnan(combined_trust(label)));
}

}  // namespace
}  // namespace q3d::filters
