// Guards on a unit's way through judging, without a network: predictions, adaptation curves and measures are
// given.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include <stdexcept>

#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/judge.h"
#include "pipeline/unit/refine.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Judgement;
using manifests::Reason;
using manifests::Verdict;

constexpr float kError = 0.25F;  // of x and of y alike, so L_proj is the same

// The first `visible` keypoints at the crop's centre; the prediction misses them by `error`.
struct GivenUnit {
  std::vector<candidates::Candidate> candidates;
  config::JudgingRules rules;
  UnitWork work;
  std::vector<PredictedSample> predicted;

  GivenUnit() {
    filters::Thresholds& limits = rules.thresholds["d"];
    limits.tau_low = 0.1875;
    limits.tau_high = 0.4375;
    limits.delta = 0.1;
    work.refined.emplace();
  }
  void add(int visible, float error) {
    candidates::Candidate& candidate = candidates.emplace_back();
    candidate.record.id = "d/train/p" + std::to_string(candidates.size()) + "#0";
    candidate.record.dataset = "d";
    candidate.record.box = {0, 0, 256, 256};
    for (int k = 0; k < visible; ++k) {
      candidate.record.keypoints[static_cast<std::size_t>(k)] = {128.0, 128.0, 1.0F, 1.0F};
    }
    predicted.emplace_back().body.keypoints_2d.fill({error, error});
  }
  void refine(std::size_t sample, std::vector<double> curve, std::vector<double> held_out = {}) {
    work.refined->push_back({sample, std::move(curve), {}, std::move(held_out)});
  }
  Judgement judge(std::size_t sample = 0) {
    set_candidates(work, candidates);
    set_predictions(work, predicted);
    judge_unit(work, rules);
    return work.judgements[sample];
  }
  device::AdaptRequest request() const {
    const manifests::SampleRecord& record = candidates[0].record;
    return adapt_request(record.id, crop_keypoints(record), {}, kError, rules.of("d"), rules.guards);
  }
};

TEST(GuardedJudging, PredictionsAreJudgedByTheirDatasetsThresholds) {
  GivenUnit unit;
  unit.add(20, 0.25F);
  unit.add(20, 0.25F);
  unit.candidates[1].record.dataset = "e";
  unit.rules.thresholds["e"] = unit.rules.of("d");
  unit.rules.thresholds["e"].tau_low = 0.3;
  EXPECT_EQ(unit.judge(0).reason, Reason::gain_too_small) << "the middle band of d, not adapted";
  EXPECT_EQ(unit.judge(1).verdict, Verdict::retained);
  unit.candidates[1].record.dataset = "f";
  EXPECT_THROW(unit.judge(1), std::out_of_range);
}

TEST(GuardedJudging, BoundsActOnRetainedAndRefinedLabels) {
  GivenUnit unit;
  unit.add(6, 0.1F);
  unit.add(6, kError);
  unit.add(9, kError);
  unit.refine(1, {0.25, 0.19});
  unit.refine(2, {0.25, 0.19});
  unit.rules.guards.visible_min = 8;
  EXPECT_EQ(unit.judge(0).verdict, Verdict::retained) << "not measured yet";
  unit.work.measured.emplace();
  for (const std::size_t sample : {0, 1, 2}) {
    MeasuredLabel& label = unit.work.measured->emplace_back();
    label.sample = sample;
    label.scores.visible = sample == 2 ? 9 : 6;
  }
  EXPECT_EQ(unit.judge(0).reason, Reason::too_few_keypoints);
  EXPECT_EQ(unit.judge(1).reason, Reason::too_few_keypoints);
  EXPECT_EQ(unit.judge(2).verdict, Verdict::refined);
}

TEST(GuardedJudging, IterationsAreScaledByVisibleKeypoints) {
  GivenUnit unit;
  unit.add(5, kError);
  // The limit is a quarter of the middle band: 10 + 50 / 4 = 22.5, rounded up to 23.
  EXPECT_EQ(unit.request().schedule.iterations, 23);
  EXPECT_FALSE(unit.request().schedule.held_out[0]);
  unit.rules.guards.iterations_full_at = 20;
  EXPECT_EQ(unit.request().schedule.iterations, 6) << "23 * 5 / 20 = 5.75";
  unit.refine(0, {0.25, 0.245, 0.245});
  const Judgement judgement = unit.judge();
  EXPECT_EQ(judgement.reason, Reason::scaled_gain_too_small);
  EXPECT_NE(judgement.detail.find("at most 6 of 23 iterations for 5 visible keypoints"), std::string::npos)
      << judgement.detail;
}

TEST(GuardedJudging, ScalingIsNotTheReasonWhereTheWindowOfTheGainIsWhole) {
  GivenUnit unit;
  unit.add(10, kError);
  unit.rules.guards.iterations_full_at = 20;
  EXPECT_EQ(unit.request().schedule.iterations, 12) << "23 * 10 / 20 = 11.5";
  unit.refine(0, {0.25, 0.245});
  EXPECT_EQ(unit.judge().reason, Reason::gain_too_small);
  unit.work.refined->front().curve = {0.25, 0.15};
  EXPECT_EQ(unit.judge().verdict, Verdict::refined);
  EXPECT_EQ(unit.judge().detail, "at most 12 of 23 iterations for 10 visible keypoints");
}

TEST(GuardedJudging, HeldOutKeypointsChooseTheIterate) {
  GivenUnit unit;
  unit.add(10, kError);
  unit.rules.guards.held_out_share = 0.2;
  unit.rules.guards.held_out_patience = 4;
  const device::AdaptRequest request = unit.request();
  EXPECT_EQ(std::count(request.schedule.held_out.begin(), request.schedule.held_out.end(), true), 2);
  EXPECT_EQ(request.schedule.patience, 4);
  EXPECT_EQ(request.keypoints, crop_keypoints(unit.candidates[0].record)) << "their weights stay";
  unit.refine(0, {0.25, 0.21, 0.205}, {0.3, 0.2, 0.25});
  EXPECT_EQ(unit.judge().best_iteration, 1);
  unit.work.refined->front().held_out_curve = {0.3, 0.31, 0.32};
  EXPECT_EQ(unit.judge().reason, Reason::held_out_not_better);
}

TEST(GuardedJudging, OneKeypointCannotBeHeldOut) {
  GivenUnit unit;
  unit.add(1, kError);
  unit.rules.guards.held_out_share = 0.2;
  EXPECT_EQ(unit.request().schedule.iterations, 0);
  unit.refine(0, {0.25});
  EXPECT_EQ(unit.judge().verdict, Verdict::discarded);
  EXPECT_EQ(unit.judge().reason, Reason::held_out_not_better);
  EXPECT_EQ(unit.judge().initial_error, 0.25);
}

// A retained label with this L_proj, after its scores were measured.
manifests::Judgement measured_judgement(float error, double min_trust) {
  GivenUnit unit;
  unit.add(10, error);
  unit.rules.min_trust = min_trust;
  EXPECT_TRUE(std::isnan(unit.judge().trust.combined)) << "not measured yet";
  EXPECT_EQ(unit.judge().verdict, Verdict::retained) << "nothing is known against it";
  MeasuredLabel& label = unit.work.measured.emplace().emplace_back();
  label.scores.visible = 10;
  label.scores.mirror = 1000.0;
  return unit.judge();
}

TEST(GuardedJudging, LabelsThatAreTrustedTooLittleAreDiscarded) {
  const manifests::Judgement good = measured_judgement(0.03F, 0.5);
  EXPECT_EQ(good.verdict, Verdict::retained);
  EXPECT_GT(good.trust.combined, 0.5);
  EXPECT_LE(good.trust.combined, 1.0);
  const manifests::Judgement bad = measured_judgement(0.1F, 0.5);
  EXPECT_EQ(bad.verdict, Verdict::discarded);
  EXPECT_EQ(bad.reason, Reason::trust_too_low);
  EXPECT_LT(bad.trust.combined, 0.5);
  EXPECT_EQ(bad.trust.mirror, 1000.0) << "the scores stay";
  EXPECT_EQ(measured_judgement(0.1F, 0.0).verdict, Verdict::retained) << "off";
}

TEST(GuardedJudging, RetainedPredictionsAreAdaptedOnRequest) {
  GivenUnit unit;
  unit.add(10, 0.125F);
  unit.add(1, 0.125F);
  for (auto& [name, limits] : unit.rules.thresholds) limits.refine_retained = true;
  EXPECT_EQ(unit.judge().verdict, Verdict::retained) << "not adapted yet";
  unit.refine(0, {0.125, 0.12});
  EXPECT_EQ(unit.judge().verdict, Verdict::refined);
  unit.work.refined->front().curve = {0.125, 0.2};
  EXPECT_EQ(unit.judge().verdict, Verdict::retained);
  // With held-out keypoints, they choose the iterate; a sample that can hold out none stays as predicted.
  unit.rules.guards.held_out_share = 0.2;
  unit.work.refined->front() = {0, {0.125, 0.12}, {}, {0.3, 0.35}};
  EXPECT_EQ(unit.judge().verdict, Verdict::retained);
  unit.refine(1, {0.125});
  EXPECT_EQ(unit.judge(1).verdict, Verdict::retained);
}

}  // namespace
}  // namespace q3d::pipeline::unit
