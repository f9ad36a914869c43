#include "pipeline/unit/predict.h"

#include <cmath>

#include "filters/fidelity.h"
#include "pipeline/unit/annotated_body.h"
#include "pipeline/unit/prediction_error.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Reason;

// Fills in the body of a candidate whose role is not `pseudo`, and notes what its label will lack.
void take_annotated_body(const candidates::Candidate& candidate, PredictedSample& sample) {
  sample.body = no_body();
  if (candidate.role != config::Role::truth) return;
  sample.body = annotated_body(*candidate.record.truth);
  for (const std::string& told : {missing_parts(*candidate.record.truth), candidate.finding}) {
    if (!told.empty()) sample.detail += (sample.detail.empty() ? "" : "; ") + told;
  }
}

// Returns what is known about a candidate before the network predicts it.
PredictedSample decoded_sample(const candidates::Candidate& candidate, const DecodedSample& decoded) {
  const manifests::SampleRecord& record = candidate.record;
  PredictedSample sample;
  sample.failure = record.failure != Reason::none ? record.failure : decoded.failure;
  sample.detail = record.failure != Reason::none ? record.failure_detail : decoded.detail;
  sample.image_width_px = decoded.image_width_px;
  sample.image_height_px = decoded.image_height_px;
  sample.has_mask = decoded.has_mask;
  return sample;
}

void take_predicted_body(const device::BodyPrediction& body, PredictedSample& sample) {
  if (device::is_finite(body)) {
    sample.body = body;
  } else {
    sample.failure = Reason::prediction_not_finite;
    sample.detail = "the network's output holds NaN or infinity";
  }
}

bool is_adapted(const UnitWork& work, std::size_t i, const PredictedSample& sample,
                const config::JudgingRules& rules) {
  const double error = error_of(sample, work.keypoints[i]);
  return !std::isnan(error) && filters::is_adapted(error, rules.of(work.candidates[i].record.dataset));
}

}  // namespace

void predict_unit(UnitWork& work, const NetworkSource& network, const Watch& watch,
                  const config::JudgingRules* rules) {
  if (work.predicted) return;
  std::vector<PredictedSample> samples(work.candidates.size());
  std::vector<device::PatchView> patches;
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = decoded_sample(work.candidates[i], work.decoded[i]);
    const bool is_pseudo = work.candidates[i].role == config::Role::pseudo;
    if (samples[i].failure == Reason::none && is_pseudo) {
      patches.emplace_back(work.decoded[i].patch);
      positions.push_back(i);
      continue;
    }
    if (samples[i].failure == Reason::none) take_annotated_body(work.candidates[i], samples[i]);
    if (watch.observer != nullptr) watch.observer->predicted(work, i, samples[i]);
  }
  if (rules != nullptr) work.features.assign(samples.size(), nullptr);
  watch.for_each_batch(patches.size(), [&](std::size_t first, std::size_t count) {
    std::vector<device::KeptFeatures> features;
    const std::vector<device::BodyPrediction> bodies =
        network().predict(std::span(patches).subspan(first, count), rules != nullptr ? &features : nullptr);
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      const std::size_t i = positions[first + j];
      take_predicted_body(bodies[j], samples[i]);
      if (rules != nullptr && is_adapted(work, i, samples[i], *rules)) work.features[i] = features.at(j);
      if (watch.observer != nullptr) watch.observer->predicted(work, i, samples[i]);
    }
    if (watch.observer != nullptr) {
      watch.observer->batch_done(work, "predict", first + count, patches.size());
    }
  });
  set_predictions(work, std::move(samples));
}

}  // namespace q3d::pipeline::unit
