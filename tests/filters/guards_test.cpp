// Each guard at its bound and on either side of it.
#include "filters/guards.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "filters/fidelity.h"

namespace q3d::filters {
namespace {

using manifests::Judgement;
using manifests::Reason;
using manifests::Verdict;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Judgement kept(Verdict verdict = Verdict::refined) {
  Judgement judgement;
  judgement.verdict = verdict;
  judgement.final_error = 0.25;
  judgement.detail = "a remark";
  return judgement;
}

// A label that every bound of all_on() lets through.
manifests::TrustScores good() {
  manifests::TrustScores measures;
  measures.visible = 8;
  measures.pose_prior = 2.0;
  measures.limbs = 1.5;
  measures.sides = 1.0;
  measures.mask = 0.5;
  return measures;
}

GuardBounds all_on() {
  GuardBounds bounds;
  bounds.visible_min = 8;
  bounds.pose_deviation_max = 2.0;
  bounds.limb_factor_max = 1.5;
  bounds.left_right_max = 1.0;
  bounds.mask_iou_min = 0.5;
  return bounds;
}

TEST(Guards, WhatLiesOnABoundIsKeptAsItWas) {
  for (const Verdict verdict : {Verdict::retained, Verdict::refined}) {
    const Judgement judgement = apply_bounds(kept(verdict), good(), all_on());
    EXPECT_EQ(judgement.verdict, verdict);
    EXPECT_EQ(judgement.reason, Reason::none);
    EXPECT_EQ(judgement.detail, "a remark");
  }
}

TEST(Guards, EachHasItsReason) {
  const auto reason_of = [](auto change) {
    manifests::TrustScores measures = good();
    change(measures);
    const Judgement judgement = apply_bounds(kept(), measures, all_on());
    EXPECT_EQ(judgement.verdict, Verdict::discarded);
    EXPECT_EQ(judgement.final_error, 0.25) << "the numbers stay";
    return judgement.reason;
  };
  EXPECT_EQ(reason_of([](auto& m) { m.visible = 7; }), Reason::too_few_keypoints);
  EXPECT_EQ(reason_of([](auto& m) { m.pose_prior = std::nextafter(2.0, 3.0); }), Reason::pose_implausible);
  EXPECT_EQ(reason_of([](auto& m) { m.limbs = kInfinity; }), Reason::limbs_implausible);
  EXPECT_EQ(reason_of([](auto& m) { m.sides = 1.01; }), Reason::left_right_swapped);
  EXPECT_EQ(reason_of([](auto& m) { m.mask = std::nextafter(0.5, 0.0); }), Reason::mask_mismatch);
}

TEST(Guards, AreOffByDefault) {
  manifests::TrustScores hopeless;
  hopeless.visible = 0;
  hopeless.pose_prior = hopeless.limbs = hopeless.sides = 1e9;
  hopeless.mask = 0.0;
  EXPECT_EQ(apply_bounds(kept(), hopeless, {}).verdict, Verdict::refined);
  EXPECT_FALSE(is_any_on({}));
  EXPECT_TRUE(is_any_on(all_on()));
  GuardBounds one;
  one.mask_iou_min = 0.1;
  EXPECT_TRUE(is_any_on(one));
}

TEST(Guards, WhatCannotBeMeasuredHasNoSay) {
  manifests::TrustScores unknown;
  unknown.visible = 8;
  EXPECT_TRUE(std::isnan(unknown.mask));
  EXPECT_EQ(apply_bounds(kept(), unknown, all_on()).verdict, Verdict::refined);
}

TEST(Guards, TheFirstBrokenBoundGivesTheReasonAndAllAreNamed) {
  manifests::TrustScores measures = good();
  measures.pose_prior = 3.0;
  measures.mask = 0.125;
  const Judgement judgement = apply_bounds(kept(), measures, all_on());
  EXPECT_EQ(judgement.reason, Reason::pose_implausible);
  EXPECT_EQ(judgement.detail, "pose_deviation 3, pose_deviation_max 2; mask_iou 0.125, mask_iou_min 0.5");
}

TEST(Guards, LeaveOtherVerdictsAlone) {
  Judgement judgement = kept();
  judgement.verdict = Verdict::discarded;
  judgement.reason = Reason::error_too_large;
  manifests::TrustScores measures = good();
  measures.visible = 0;
  const Judgement after = apply_bounds(judgement, measures, all_on());
  EXPECT_EQ(after.reason, Reason::error_too_large);
  EXPECT_EQ(after.detail, "a remark");
}

TEST(Guards, BoundsOutOfRangeAreRefused) {
  const auto expect_refused = [](auto change, const std::string& rule) {
    GuardBounds bounds = all_on();
    change(bounds);
    EXPECT_THAT([&] { check(bounds); }, ThrowsMessage<std::invalid_argument>(HasSubstr(rule)));
  };
  EXPECT_NO_THROW(check(all_on()));
  EXPECT_NO_THROW(check(GuardBounds{}));
  expect_refused([](auto& b) { b.visible_min = 27; }, "visible_min");
  expect_refused([](auto& b) { b.visible_min = -1; }, "visible_min");
  expect_refused([](auto& b) { b.pose_deviation_max = kNan; }, "pose_deviation_max");
  expect_refused([](auto& b) { b.limb_factor_max = -1.0; }, "limb_factor_max");
  expect_refused([](auto& b) { b.left_right_max = kInfinity; }, "left_right_max");
  expect_refused([](auto& b) { b.mask_iou_min = 1.5; }, "mask_iou_min");
}

TEST(ScaledIterations, AreInProportionToTheVisibleKeypoints) {
  EXPECT_EQ(scaled_iterations(40, 9, 18), 20);
  EXPECT_EQ(scaled_iterations(10, 5, 20), 3) << "2.5, halves up";
  EXPECT_EQ(scaled_iterations(60, 18, 18), 60);
  EXPECT_EQ(scaled_iterations(60, 26, 18), 60);
  EXPECT_EQ(scaled_iterations(10, 1, 26), 1) << "at least one";
  EXPECT_EQ(scaled_iterations(40, 3, 0), 40) << "off";
  EXPECT_THROW(scaled_iterations(-1, 3, 4), std::invalid_argument);
}

// --- the held-out rule

Thresholds make_thresholds() {
  Thresholds t;
  t.tau_low = 0.25;
  t.tau_high = 0.75;
  t.delta = 0.25;
  return t;
}

TEST(HeldOut, KeepsTheIterateOfLeastHeldOutError) {
  // L_proj falls on, the held-out error turns after iterate 2.
  const std::vector<double> curve{0.5, 0.4375, 0.375, 0.3125};
  const std::vector<double> held_out{0.6, 0.55, 0.5, 0.7};
  const Judgement judgement = judge_held_out(curve, held_out, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::refined);
  EXPECT_EQ(judgement.best_iteration, 2);
  EXPECT_EQ(judgement.final_error, 0.375) << "L_proj of the kept iterate, over all visible keypoints";
  EXPECT_EQ(judgement.gain, 0.375) << "the paper's gain: (0.5 - 0.3125) / 0.5";
  EXPECT_EQ(judge_adapted(curve, make_thresholds()).best_iteration, 3);
}

TEST(HeldOut, DiscardsWhereNoIterateHelpsThePointsItHasNotSeen) {
  const Judgement judgement =
      judge_held_out(std::vector{0.5, 0.3, 0.26}, std::vector{0.6, 0.6, 0.8}, make_thresholds());
  EXPECT_EQ(judgement.verdict, Verdict::discarded);
  EXPECT_EQ(judgement.reason, Reason::held_out_not_better);
  EXPECT_EQ(judgement.best_iteration, 0);
  EXPECT_EQ(judgement.final_error, 0.5);
}

TEST(HeldOut, ThePapersRuleComesFirst) {
  const Judgement judgement =
      judge_held_out(std::vector{0.5, 0.49}, std::vector{0.6, 0.7}, make_thresholds());
  EXPECT_EQ(judgement.reason, Reason::gain_too_small);
}

TEST(HeldOut, ASmallGainDiscardsBelowTauLowToo) {
  // The error begins at 0.28. It gains 0.14 and is below tau_low at iterate 2.
  const std::vector<double> curve{0.28, 0.26, 0.24};
  EXPECT_EQ(judge_held_out(curve, std::vector{0.5, 0.4, 0.3}, make_thresholds()).reason,
            Reason::gain_too_small);
}

TEST(HeldOut, WantsAsManyErrorsAsIterates) {
  EXPECT_THROW(judge_held_out(std::vector{0.5, 0.4}, std::vector{0.5}, make_thresholds()),
               std::invalid_argument);
  EXPECT_EQ(judge_held_out({}, {}, make_thresholds()).reason, Reason::prediction_not_finite);
  EXPECT_EQ(judge_held_out(std::vector{0.5}, std::vector{kNan}, make_thresholds()).reason,
            Reason::prediction_not_finite);
}

}  // namespace
}  // namespace q3d::filters
