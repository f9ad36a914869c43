#include "pipeline/unit/predict.h"

#include "pipeline/unit/annotated_body.h"

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

}  // namespace

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
  set_predictions(work, std::move(samples));
}

}  // namespace q3d::pipeline::unit
