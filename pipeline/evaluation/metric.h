// The metrics of the paper's tables on one sample. docs/evaluation.md defines each number.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "manifests/sample.h"
#include "pipeline/device/body_meshes.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::evaluation {

enum class Metric : std::uint8_t { auc, pck_10, pck_15, l_proj, pa_mpjpe, pa_mpvpe };
inline constexpr std::size_t kMetricCount = 6;

struct MetricInfo {
  Metric metric;
  const char* key;    // in JSON and CSV
  const char* title;  // in tables for people
  int decimals;       // shown in tables for people
  bool higher_is_better;
  bool needs_body;  // 3D truth; the others need a visible keypoint
};
// The entries are in the order of the enumerators.
extern const std::array<MetricInfo, kMetricCount> kMetrics;

// The values of a sample, by Metric. A value is missing where the sample lacks what the metric needs. Units
// are percent for auc and pck_*, crop units for l_proj, mm for pa_* where the body's unit is the metre.
using MetricValues = std::array<std::optional<double>, kMetricCount>;
inline std::size_t index_of(Metric metric) {
  return static_cast<std::size_t>(metric);
}

struct MetricMean {
  std::optional<double> mean;
  std::int64_t samples = 0;  // number of samples in the mean
};
// Returns the mean of one metric. A sample without a value is left out, or is 0 with `missing_is_zero`.
MetricMean mean_of(std::span<const MetricValues* const> samples, std::size_t metric,
                   bool missing_is_zero = false);

// The truth against which a prediction is measured.
struct Target {
  device::CropKeypoints keypoints{};         // annotated
  double normaliser_px = smal::kCropSidePx;  // sqrt(mask area) of the 256-px crop, or 256 for the whole crop
  bool normalised_by_mask = false;
  std::optional<smal::Keypoints3d> keypoints_3d;
  std::vector<float> vertices;  // V x 3, SMAL units; empty when the true mesh is not known
};

// Returns the target of a record and its decoded picture, without the mesh.
Target make_target(const manifests::SampleRecord& record, double mask_area_px);

// Measures a body. `mesh` is that of the predicted body; it is needed if the target has vertices, and may be
// null otherwise.
MetricValues measure(const device::BodyPrediction& body, const device::BodyMesh* mesh, const Target& target);

// Poses the true bodies of the records that state pose and shape, and sets the vertices of their targets.
// Also sets keypoints_3d if the record lacks them. targets[i] belongs to records[i].
void add_true_meshes(std::span<const manifests::SampleRecord* const> records,
                     const device::BodyMeshes& meshes, std::span<Target> targets);

}  // namespace q3d::pipeline::evaluation
