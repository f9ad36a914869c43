// What the guards' bounds look at, of every label that the fidelity rule keeps.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "filters/guard_measures.h"
#include "pipeline/body_meshes.h"
#include "pipeline/build_config.h"
#include "pipeline/unit_work.h"

namespace q3d::pipeline {

// The file of priors that the guards use: their own, else the checkpoint, whose official form holds them.
std::filesystem::path priors_file(const BuildConfig& config);
bool uses_priors(const GuardConfig& guards);

class LabelMeasurer {
 public:
  // Loads what the bounds that are on need: priors, body model. Call it and measure() on the device's thread.
  // Throws std::runtime_error naming the file, and `guards.priors` when it holds no priors.
  explicit LabelMeasurer(const BuildConfig& config);

  // Of the candidates with pseudo labels that work.judgements keeps, in their order; work.decoded must hold
  // the masks. A number whose bound is off is NaN.
  std::vector<MeasuredLabel> measure(const UnitWork& work) const;

 private:
  filters::LabelMeasures measure_one(const CropKeypoints& keypoints, const BodyPrediction& body,
                                     const BodyMesh* mesh, const DecodedSample* decoded) const;

  GuardConfig guards_;
  std::optional<filters::PosePrior> pose_prior_;
  std::optional<filters::LimbRange> limb_range_;
  std::unique_ptr<BodyMeshes> meshes_;  // null when no bound needs a body
  std::vector<std::array<std::int32_t, 3>> faces_;
};

}  // namespace q3d::pipeline
