// Measures the trust scores of every label that the fidelity rule keeps. The guards' bounds use some of them.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "filters/guard_measures.h"
#include "pipeline/device/body_meshes.h"
#include "pipeline/unit/network_source.h"
#include "pipeline/unit/step_observer.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// The models with which labels are measured.
struct MeasuringModels {
  std::unique_ptr<device::BodyMeshes> meshes;
  std::optional<device::PriorNumbers> priors;  // without them the scores that need them are NaN
};

class LabelMeasurer {
 public:
  // Throws std::invalid_argument without a body model.
  explicit LabelMeasurer(MeasuringModels models);

  // Returns the scores of the candidates with pseudo labels that work.judgements keeps, in their order.
  // work.decoded must hold their patches, which are mirrored and predicted in batches inside the unit, and
  // their masks.
  std::vector<MeasuredLabel> measure(const UnitWork& work, const NetworkSource& network,
                                     const Watch& watch = {}) const;

 private:
  struct Label;
  static std::vector<Label> kept_labels(const UnitWork& work);
  manifests::TrustScores measure_one(const UnitWork& work, const Label& label,
                                     const device::BodyMesh& mesh) const;

  std::vector<int> mirror_;  // index of the mirror image of each of the 26 keypoints
  std::optional<device::PriorNumbers> priors_;
  std::optional<filters::LimbRange> limb_range_;
  std::unique_ptr<device::BodyMeshes> meshes_;
  std::vector<std::array<std::int32_t, 3>> faces_;
};

// Returns the patch (256 x 256 x 3, row-major) with left and right exchanged.
std::vector<std::uint8_t> mirrored_patch(device::PatchView patch);

}  // namespace q3d::pipeline::unit
