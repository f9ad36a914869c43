// What the guards' bounds look at, of every label that the fidelity rule keeps.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "filters/guard_measures.h"
#include "pipeline/config/build_config.h"
#include "pipeline/device/body_meshes.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// What the bounds that are on measure with.
struct MeasuringModels {
  std::unique_ptr<device::BodyMeshes> meshes;  // where needs_meshes
  std::optional<device::PriorNumbers> priors;  // where uses_priors
};
bool needs_meshes(const config::GuardConfig& guards);

class LabelMeasurer {
 public:
  // Throws std::invalid_argument when a model that a bound needs is missing.
  LabelMeasurer(const config::GuardConfig& guards, MeasuringModels models);

  // Of the candidates with pseudo labels that work.judgements keeps, in their order; work.decoded must hold
  // the masks. A number whose bound is off is NaN.
  std::vector<MeasuredLabel> measure(const UnitWork& work) const;

 private:
  filters::LabelMeasures measure_one(const device::CropKeypoints& keypoints,
                                     const device::BodyPrediction& body, const device::BodyMesh* mesh,
                                     const DecodedSample* decoded) const;

  config::GuardConfig guards_;
  std::optional<filters::PosePrior> pose_prior_;
  std::optional<filters::LimbRange> limb_range_;
  std::unique_ptr<device::BodyMeshes> meshes_;  // null when no bound needs a body
  std::vector<std::array<std::int32_t, 3>> faces_;
};

}  // namespace q3d::pipeline::unit
