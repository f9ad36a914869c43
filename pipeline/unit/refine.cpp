#include "pipeline/unit/refine.h"

#include <cmath>
#include <utility>

#include "filters/keypoint_choice.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::unit {

device::AdaptRequest adapt_request(const std::string& id, const device::CropKeypoints& keypoints,
                                   device::PatchView patch, double error,
                                   const filters::Thresholds& thresholds, const config::GuardConfig& guards) {
  device::AdaptRequest request;
  request.patch = patch;
  request.keypoints = keypoints;
  request.schedule = filters::adaptation_schedule(error, thresholds);
  const int visible = visible_keypoints(request.keypoints);
  request.schedule.iterations =
      filters::scaled_iterations(request.schedule.iterations, visible, guards.iterations_full_at);
  if (guards.held_out_share == 0.0) return request;
  request.schedule.held_out =
      filters::held_out_keypoints(request.keypoints, guards.held_out_share, guards.held_out_seed, id);
  request.schedule.patience = guards.held_out_patience;
  if (visible < 2) request.schedule.iterations = 0;
  return request;
}

void refine_unit(UnitWork& work, const NetworkSource& network, const config::JudgingRules& rules,
                 StepObserver* observer) {
  if (work.refined) return;
  std::vector<device::AdaptRequest> requests;
  std::vector<RefinedSample> samples;
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    const candidates::Candidate& candidate = work.candidates[i];
    if (candidate.role != config::Role::pseudo || std::isnan(work.errors[i])) continue;
    const filters::Thresholds& thresholds = rules.of(candidate.record.dataset);
    if (!filters::is_adapted(work.errors[i], thresholds)) continue;
    requests.push_back(adapt_request(candidate.record.id, work.keypoints[i], work.decoded[i].patch,
                                     work.errors[i], thresholds, rules.guards));
    if (!work.features.empty()) requests.back().features = std::move(work.features[i]);
    samples.emplace_back().sample = i;
  }
  work.features.clear();
  if (!requests.empty()) {
    const auto progress = [&](std::size_t ended) {
      if (observer != nullptr) observer->batch_done(work, "refine", ended, requests.size());
    };
    std::vector<device::AdaptOutcome> outcomes = network().adapt(requests, {}, progress);
    for (std::size_t j = 0; j < outcomes.size(); ++j) {
      samples[j].curve = std::move(outcomes[j].curve);
      samples[j].held_out_curve = std::move(outcomes[j].held_out_curve);
      samples[j].body = outcomes[j].best;
      if (observer != nullptr) observer->refined(work, samples[j]);
    }
    progress(requests.size());
  }
  work.refined = std::move(samples);
}

}  // namespace q3d::pipeline::unit
