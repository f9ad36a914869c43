#include "pipeline/unit/refine.h"

#include <cmath>

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
                 const Watch& watch) {
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
    samples.emplace_back().sample = i;
  }
  watch.for_each_batch(requests.size(), [&](std::size_t first, std::size_t count) {
    std::vector<device::AdaptOutcome> outcomes = network().adapt(std::span(requests).subspan(first, count));
    for (std::size_t j = 0; j < outcomes.size(); ++j) {
      RefinedSample& sample = samples[first + j];
      sample.curve = std::move(outcomes[j].curve);
      sample.held_out_curve = std::move(outcomes[j].held_out_curve);
      sample.body = outcomes[j].best;
      if (watch.observer != nullptr) watch.observer->refined(work, sample);
    }
    if (watch.observer != nullptr) watch.observer->batch_done(work, "refine", first + count, requests.size());
  });
  work.refined = std::move(samples);
}

}  // namespace q3d::pipeline::unit
