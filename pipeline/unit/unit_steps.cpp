#include "pipeline/unit/unit_steps.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <optional>

#include "filters/keypoint_choice.h"
#include "filters/metrics.h"
#include "loaders/pictures/box.h"
#include "loaders/pictures/crop.h"
#include "loaders/pictures/encode.h"
#include "loaders/pictures/image.h"
#include "loaders/pictures/stored_crop.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/unit/annotated_body.h"

namespace q3d::pipeline::unit {
namespace {

using filters::Band;
using manifests::Reason;
using manifests::Verdict;

bool is_kept(const manifests::Judgement& judgement) {
  return judgement.verdict == Verdict::retained || judgement.verdict == Verdict::refined;
}

// Nothing when the picture is not needed at all.
std::optional<Wanted> wanted(const UnitWork& work, std::size_t i, const config::JudgingRules* rules) {
  const candidates::Candidate& candidate = work.candidates[i];
  if (candidate.record.failure != Reason::none) return std::nullopt;
  const bool is_pseudo = candidate.role == config::Role::pseudo;
  const bool is_left_out = candidate.exclusion.reason != Reason::none;
  const bool makes_shard = rules != nullptr && !work.shard_before && !is_left_out;
  const bool measures_mask = is_pseudo && rules != nullptr && rules->guards.mask_iou_min > 0.0 &&
                             !work.measured && !candidate.record.mask_path.empty();
  if (!work.predicted) {
    return Wanted{.patch = is_pseudo, .stored_crop = makes_shard, .patch_mask = measures_mask};
  }
  if (rules == nullptr || (*work.predicted)[i].failure != Reason::none) return std::nullopt;
  if (!is_pseudo) return makes_shard ? std::optional(Wanted{.stored_crop = true}) : std::nullopt;
  const double error = initial_error(candidate, (*work.predicted)[i]);
  if (std::isnan(error)) return std::nullopt;
  const Band band = filters::band(error, rules->of(candidate.record.dataset));
  const bool may_be_kept = work.refined ? is_kept(work.judgements[i]) : band != Band::discard;
  const Wanted want{.patch = band == Band::refine && !work.refined,
                    .stored_crop = may_be_kept && makes_shard,
                    .patch_mask = may_be_kept && measures_mask};
  return want.patch || want.stored_crop || want.patch_mask ? std::optional(want) : std::nullopt;
}

void store_crop(DecodedSample& sample, const cv::Mat& rgb, const cv::Mat& mask,
                const loaders::pictures::SquareBox& box, const config::ShardConfig& shards) {
  const loaders::pictures::StoredCrop crop =
      loaders::pictures::make_stored_crop(rgb, mask, box, shards.crop_scale, shards.crop_min_side_px);
  sample.stored_side_px = crop.rgb.cols;
  sample.stored_from_image = crop.from_image;
  if (shards.images == "reference") return;
  sample.stored_crop = shards.images == "png" ? loaders::pictures::encode_png(crop.rgb)
                                              : loaders::pictures::encode_jpeg(crop.rgb, shards.jpeg_quality);
  if (!crop.mask.empty()) sample.stored_mask = loaders::pictures::encode_png(crop.mask);
}

manifests::Judgement failed(Reason reason, const std::string& detail) {
  manifests::Judgement judgement;
  judgement.verdict = Verdict::failed;
  judgement.reason = reason;
  judgement.detail = detail;
  return judgement;
}

// adapt_request lets a sample of one visible keypoint take no step: nothing could tell whether it helped.
manifests::Judgement nothing_to_hold_out(const RefinedSample& refined) {
  manifests::Judgement judgement;
  judgement.verdict = Verdict::discarded;
  judgement.reason = Reason::held_out_not_better;
  judgement.detail = "one visible keypoint: none can be held out";
  judgement.initial_error = refined.curve[0];
  judgement.final_error = refined.curve[0];
  return judgement;
}

// What the network has no part in is kept as it came.
manifests::Judgement judge_annotated(const candidates::Candidate& candidate,
                                     const device::BodyPrediction& body) {
  manifests::Judgement judgement;
  judgement.verdict = Verdict::retained;
  if (has_projection(body.keypoints_2d)) {
    judgement.final_error = filters::projection_error(body.keypoints_2d, crop_keypoints(candidate.record))
                                .value_or(std::numeric_limits<double>::quiet_NaN());
  }
  return judgement;
}

manifests::Judgement judge_predicted(const candidates::Candidate& candidate, const PredictedSample& predicted,
                                     const config::JudgingRules& rules) {
  if (predicted.failure != Reason::none) return failed(predicted.failure, predicted.detail);
  if (candidate.role != config::Role::pseudo) return judge_annotated(candidate, predicted.body);
  return filters::judge_initial(initial_error(candidate, predicted), rules.of(candidate.record.dataset));
}

// What is excluded keeps its numbers; what failed stays failed.
void apply_exclusion(const candidates::Exclusion& exclusion, manifests::Judgement& judgement) {
  if (exclusion.reason == Reason::none || judgement.verdict == Verdict::failed) return;
  judgement.verdict = Verdict::discarded;
  judgement.reason = exclusion.reason;
  judgement.detail = exclusion.detail;
}

// The body of a candidate whose role is not `pseudo`, and what its label will lack.
void take_annotated_body(const candidates::Candidate& candidate, PredictedSample& sample) {
  sample.body = no_body();
  if (candidate.role != config::Role::truth) return;
  sample.body = annotated_body(*candidate.record.truth);
  for (const std::string& told : {missing_parts(*candidate.record.truth), candidate.finding}) {
    if (!told.empty()) sample.detail += (sample.detail.empty() ? "" : "; ") + told;
  }
}

}  // namespace

DecodedSample decode_sample(const manifests::SampleRecord& record, Wanted want,
                            const config::ShardConfig& shards) {
  DecodedSample sample;
  const loaders::pictures::DecodedImage image = loaders::pictures::decode_image(record.image_path);
  if (image.failure != Reason::none) {
    sample.failure = image.failure;
    sample.detail = image.detail;
    return sample;
  }
  // A mask that is absent, unreadable or no silhouette leaves the sample without one; the latter two are
  // told.
  const loaders::pictures::DecodedMask mask = loaders::pictures::decode_mask(record.mask_path);
  const bool has_mask = mask.silhouette.size() == image.rgb.size();
  if (!has_mask && mask.kind != loaders::pictures::MaskKind::absent) {
    sample.detail =
        "the mask is left out: " + (mask.detail.empty() ? "it is not of the picture's size" : mask.detail);
  }
  sample.image_width_px = image.rgb.cols;
  sample.image_height_px = image.rgb.rows;
  sample.has_mask = has_mask;
  if (const auto problem = loaders::pictures::find_box_problem(record.box, image.rgb.cols, image.rgb.rows)) {
    sample.failure = problem->reason;
    sample.detail = fmt::format("got {}, expected {}", problem->got, problem->expected);
    return sample;
  }
  const loaders::pictures::SquareBox square = loaders::pictures::square_box(record.box);
  if (want.patch || want.patch_mask) {
    const bool warps_mask = (want.mask_area || want.patch_mask) && has_mask;
    const loaders::pictures::Patch patch =
        loaders::pictures::make_patch(image.rgb, warps_mask ? mask.silhouette : cv::Mat(), square);
    sample.patch.assign(patch.rgb.datastart, patch.rgb.dataend);
    // Official evaluator: the sum of the warped mask / 255, soft edges included.
    if (patch.has_mask) sample.mask_area_px = cv::sum(patch.mask)[0] / 255.0;
    if (want.patch_mask && patch.has_mask) {
      sample.patch_mask.assign(patch.mask.datastart, patch.mask.dataend);
    }
  }
  if (want.stored_crop) store_crop(sample, image.rgb, has_mask ? mask.silhouette : cv::Mat(), square, shards);
  sample.decoded = true;
  return sample;
}

device::CropKeypoints crop_keypoints(const manifests::SampleRecord& record) {
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(record.box);
  return loaders::pictures::keypoints_to_crop(
      record.keypoints, loaders::pictures::patch_from_image(box, loaders::pictures::kPatchSidePx));
}

double initial_error(const candidates::Candidate& candidate, const PredictedSample& predicted) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (predicted.failure != Reason::none || candidate.role != config::Role::pseudo) return kNone;
  return filters::projection_error(predicted.body.keypoints_2d, crop_keypoints(candidate.record))
      .value_or(kNone);
}

void decode_unit(UnitWork& work, const config::ShardConfig& shards, const config::JudgingRules* rules) {
  work.decoded.assign(work.candidates.size(), {});
  tbb::parallel_for(std::size_t{0}, work.candidates.size(), [&](std::size_t i) {
    if (run::interrupted()) return;
    if (const auto want = wanted(work, i, rules)) {
      work.decoded[i] = decode_sample(work.candidates[i].record, *want, shards);
    }
  });
}

void predict_unit(UnitWork& work, const NetworkSource& network) {
  if (work.predicted) return;
  std::vector<PredictedSample> samples(work.candidates.size());
  std::vector<device::PatchView> patches;
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const manifests::SampleRecord& record = work.candidates[i].record;
    const DecodedSample& decoded = work.decoded[i];
    samples[i].failure = record.failure != Reason::none ? record.failure : decoded.failure;
    samples[i].detail = record.failure != Reason::none ? record.failure_detail : decoded.detail;
    samples[i].image_width_px = decoded.image_width_px;
    samples[i].image_height_px = decoded.image_height_px;
    samples[i].has_mask = decoded.has_mask;
    if (samples[i].failure != Reason::none) continue;
    if (work.candidates[i].role != config::Role::pseudo) {
      take_annotated_body(work.candidates[i], samples[i]);
      continue;
    }
    patches.emplace_back(decoded.patch);
    positions.push_back(i);
  }
  std::vector<device::BodyPrediction> bodies;
  if (!patches.empty()) bodies = network().predict(patches);
  for (std::size_t j = 0; j < bodies.size(); ++j) {
    PredictedSample& sample = samples[positions[j]];
    if (device::is_finite(bodies[j])) {
      sample.body = bodies[j];
    } else {
      sample.failure = Reason::prediction_not_finite;
      sample.detail = "the network's output holds NaN or infinity";
    }
  }
  work.predicted = std::move(samples);
}

int visible_keypoints(const device::CropKeypoints& keypoints) {
  int visible = 0;
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) visible += keypoints[3 * k + 2] > 0.0F ? 1 : 0;
  return visible;
}

manifests::Judgement judge_refined(const manifests::SampleRecord& record, double error,
                                   const RefinedSample& refined, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards) {
  if (refined.curve.empty()) {
    return failed(Reason::prediction_not_finite, "nothing could be measured in adaptation");
  }
  const int visible = visible_keypoints(crop_keypoints(record));
  if (guards.held_out_share > 0.0 && refined.held_out_curve.empty()) return nothing_to_hold_out(refined);
  manifests::Judgement judgement =
      guards.held_out_share > 0.0 ? filters::judge_held_out(refined.curve, refined.held_out_curve, thresholds)
                                  : filters::judge_adapted(refined.curve, thresholds);
  if (visible >= guards.iterations_full_at) return judgement;
  const int unscaled = filters::adaptation_iterations(error, thresholds);
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
    work.judgements[i] = judge_predicted(work.candidates[i], (*work.predicted)[i], rules);
  }
  if (work.refined) {
    for (const RefinedSample& refined : *work.refined) {
      const candidates::Candidate& candidate = work.candidates[refined.sample];
      const double error = initial_error(candidate, (*work.predicted)[refined.sample]);
      work.judgements[refined.sample] =
          judge_refined(candidate.record, error, refined, rules.of(candidate.record.dataset), rules.guards);
    }
  }
  if (work.measured) {
    for (const MeasuredLabel& label : *work.measured) {
      manifests::Judgement& judgement = work.judgements[label.sample];
      judgement = filters::apply_bounds(std::move(judgement), label.measures, rules.guards);
    }
  }
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    apply_exclusion(work.candidates[i].exclusion, work.judgements[i]);
    std::string& detail = work.judgements[i].detail;
    if (detail.empty()) detail = (*work.predicted)[i].detail;
  }
}

device::AdaptRequest adapt_request(const manifests::SampleRecord& record, device::PatchView patch,
                                   double error, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards) {
  device::AdaptRequest request;
  request.patch = patch;
  request.keypoints = crop_keypoints(record);
  const int visible = visible_keypoints(request.keypoints);
  request.iterations = filters::scaled_iterations(filters::adaptation_iterations(error, thresholds), visible,
                                                  guards.iterations_full_at);
  request.stop_below = thresholds.tau_low;
  request.min_gain = thresholds.delta;
  request.gain_window = thresholds.gain_window;
  if (guards.held_out_share == 0.0) return request;
  request.held_out =
      filters::held_out_keypoints(request.keypoints, guards.held_out_share, guards.held_out_seed, record.id);
  request.patience = guards.held_out_patience;
  if (visible < 2) request.iterations = 0;
  return request;
}

void refine_unit(UnitWork& work, const NetworkSource& network, const config::JudgingRules& rules) {
  if (work.refined) return;
  std::vector<device::AdaptRequest> requests;
  std::vector<RefinedSample> samples;
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    const double error = initial_error(work.candidates[i], (*work.predicted)[i]);
    if (std::isnan(error)) continue;
    const manifests::SampleRecord& record = work.candidates[i].record;
    const filters::Thresholds& thresholds = rules.of(record.dataset);
    if (filters::band(error, thresholds) != Band::refine) continue;
    requests.push_back(adapt_request(record, work.decoded[i].patch, error, thresholds, rules.guards));
    samples.emplace_back().sample = i;
  }
  std::vector<device::AdaptOutcome> outcomes;
  if (!requests.empty()) outcomes = network().adapt(requests);
  for (std::size_t j = 0; j < outcomes.size(); ++j) {
    samples[j].curve = std::move(outcomes[j].curve);
    samples[j].held_out_curve = std::move(outcomes[j].held_out_curve);
    samples[j].body = outcomes[j].best;
  }
  work.refined = std::move(samples);
}

}  // namespace q3d::pipeline::unit
