#include "pipeline/unit/judge.h"

#include <fmt/format.h>

#include "filters/trust.h"
#include "manifests/enumerators.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Reason;
using manifests::Verdict;

manifests::Judgement failed(Reason reason, const std::string& detail) {
  manifests::Judgement judgement;
  judgement.verdict = Verdict::failed;
  judgement.reason = reason;
  judgement.detail = detail;
  return judgement;
}

// Judges a sample with one visible keypoint if keypoints are held out. adapt_request (refine.h) gives it no
// iterations, because no keypoint could show whether adaptation helped.
manifests::Judgement nothing_to_hold_out(const RefinedSample& refined) {
  manifests::Judgement judgement;
  judgement.verdict = Verdict::discarded;
  judgement.reason = Reason::held_out_not_better;
  judgement.detail = "one visible keypoint: none can be held out";
  judgement.initial_error = refined.curve[0];
  judgement.final_error = refined.curve[0];
  return judgement;
}

// Keeps a label in which the network has no part. `error` is L_proj of its body, or NaN.
manifests::Judgement judge_annotated(double error) {
  manifests::Judgement judgement;
  judgement.verdict = Verdict::retained;
  judgement.final_error = error;
  return judgement;
}

// Discards a label that is trusted too little.
void apply_min_trust(double min_trust, manifests::Judgement& judgement) {
  if (!is_kept(judgement) || !(judgement.trust.combined < min_trust)) return;
  judgement.verdict = Verdict::discarded;
  judgement.reason = Reason::trust_too_low;
  judgement.detail = fmt::format("trust {:.4g}, min_trust {:.4g}", judgement.trust.combined, min_trust);
}

}  // namespace

manifests::Judgement judge_predicted(const candidates::Candidate& candidate, const PredictedSample& predicted,
                                     double error, const config::JudgingRules& rules) {
  if (predicted.failure != Reason::none) return failed(predicted.failure, predicted.detail);
  if (candidate.role != config::Role::pseudo) return judge_annotated(error);
  return filters::judge_initial(error, rules.of(candidate.record.dataset));
}

void apply_exclusion(const candidates::Exclusion& exclusion, manifests::Judgement& judgement) {
  if (exclusion.reason == Reason::none || judgement.verdict == Verdict::failed) return;
  judgement.verdict = Verdict::discarded;
  judgement.reason = exclusion.reason;
  judgement.detail = exclusion.detail;
}

manifests::Judgement judge_refined(const device::CropKeypoints& keypoints, double error,
                                   const RefinedSample& refined, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards) {
  if (refined.curve.empty()) {
    return failed(Reason::prediction_not_finite, "nothing could be measured in adaptation");
  }
  const bool holds_out = guards.held_out_share > 0.0;
  const bool is_retained = filters::band(error, thresholds) == filters::Band::retain;
  // A sample with a single visible keypoint cannot hold one out.
  if (holds_out && refined.held_out_curve.empty() && !is_retained) return nothing_to_hold_out(refined);
  manifests::Judgement judgement;
  if (is_retained) {  // it was adapted because of tta.refine_retained
    const bool has_held_out = !refined.held_out_curve.empty();
    judgement = filters::judge_retained(refined.curve, has_held_out ? refined.held_out_curve : refined.curve,
                                        thresholds);
  } else if (holds_out) {
    judgement = filters::judge_held_out(refined.curve, refined.held_out_curve, thresholds);
  } else {
    judgement = filters::judge_adapted(refined.curve, thresholds);
  }
  // The guard iterations_full_at has shortened the adaptation of a sample with few visible keypoints.
  const int visible = visible_keypoints(keypoints);
  if (visible >= guards.iterations_full_at) return judgement;
  const int unscaled = filters::adaptation_schedule(error, thresholds).iterations;
  const int scaled = filters::scaled_iterations(unscaled, visible, guards.iterations_full_at);
  if (judgement.reason == Reason::gain_too_small && scaled < thresholds.gain_window) {
    judgement.reason = Reason::scaled_gain_too_small;
  }
  judgement.detail += fmt::format("{}at most {} of {} iterations for {} visible keypoints",
                                  judgement.detail.empty() ? "" : "; ", scaled, unscaled, visible);
  return judgement;
}

void judge_unit(UnitWork& work, const config::JudgingRules& rules) {
  work.judgements.assign(work.candidates.size(), {});
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    work.judgements[i] = judge_predicted(work.candidates[i], (*work.predicted)[i], work.errors[i], rules);
  }
  if (work.refined) {
    for (const RefinedSample& refined : *work.refined) {
      const std::size_t i = refined.sample;
      work.judgements[i] = judge_refined(work.keypoints[i], work.errors[i], refined,
                                         rules.of(work.candidates[i].record.dataset), rules.guards);
    }
  }
  if (work.measured) {
    for (const MeasuredLabel& label : *work.measured) {
      manifests::Judgement& judgement = work.judgements[label.sample];
      judgement.trust = label.scores;
      judgement.trust.combined = filters::combined_trust(judgement);
      judgement = filters::apply_bounds(std::move(judgement), label.scores, rules.guards);
      apply_min_trust(rules.min_trust, judgement);
    }
  }
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    apply_exclusion(work.candidates[i].exclusion, work.judgements[i]);
    std::string& detail = work.judgements[i].detail;
    if (detail.empty()) detail = (*work.predicted)[i].detail;
  }
}

bool is_kept(const manifests::Judgement& judgement) {
  return manifests::is_kept(judgement.verdict);
}

}  // namespace q3d::pipeline::unit
