#include "pipeline/unit/unit_work.h"

#include <algorithm>

#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/prediction_error.h"

namespace q3d::pipeline::unit {

void set_candidates(UnitWork& work, std::span<const candidates::Candidate> candidates) {
  work.candidates = candidates;
  work.keypoints.assign(candidates.size(), {});
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const manifests::SampleRecord& record = candidates[i].record;
    if (record.failure == manifests::Reason::none) work.keypoints[i] = crop_keypoints(record);
  }
}

std::shared_ptr<UnitWork> open_unit(const candidates::Ingest& ingest, std::int64_t index) {
  auto work = std::make_shared<UnitWork>();
  work->unit = &ingest.units[static_cast<std::size_t>(index)];
  work->own_candidates = ingest.candidates.read(work->unit->first, work->unit->count);
  set_candidates(*work, work->own_candidates);
  return work;
}

void set_predictions(UnitWork& work, std::vector<PredictedSample> samples) {
  work.errors.resize(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) work.errors[i] = error_of(samples[i], work.keypoints[i]);
  work.predicted = std::move(samples);
}

const EncodedCrop* find_crop(const UnitWork& work, std::size_t sample) {
  const auto found =
      std::lower_bound(work.crops.begin(), work.crops.end(), sample,
                       [](const EncodedCrop& crop, std::size_t value) { return crop.sample < value; });
  return found == work.crops.end() || found->sample != sample ? nullptr : &*found;
}

}  // namespace q3d::pipeline::unit
