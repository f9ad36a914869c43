#include "pipeline/unit/refine.h"

#include <cmath>

#include "filters/keypoint_choice.h"
#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/judge.h"

namespace q3d::pipeline::unit {

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
    if (filters::band(error, thresholds) != filters::Band::refine) continue;
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
