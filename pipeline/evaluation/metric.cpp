#include "pipeline/evaluation/metric.h"

#include <cmath>
#include <stdexcept>

#include "filters/metrics.h"
#include "pipeline/unit/crop_keypoints.h"
#include "smal/axis_angle.h"

namespace q3d::pipeline::evaluation {
namespace {

std::optional<double> percent(std::optional<double> fraction) {
  return fraction ? std::optional(100.0 * *fraction) : std::nullopt;
}

}  // namespace

const std::array<MetricInfo, kMetricCount> kMetrics{{
    {Metric::auc, "auc", "AUC", 2, true, false},
    {Metric::pck_10, "pck_0.10", "PCK@0.1", 2, true, false},
    {Metric::pck_15, "pck_0.15", "PCK@0.15", 2, true, false},
    {Metric::l_proj, "l_proj", "L_proj", 4, false, false},
    {Metric::pa_mpjpe, "pa_mpjpe_mm", "PA-MPJPE", 1, false, true},
    {Metric::pa_mpvpe, "pa_mpvpe_mm", "PA-MPVPE", 1, false, true},
}};

MetricMean mean_of(std::span<const MetricValues* const> samples, std::size_t metric, bool missing_is_zero) {
  MetricMean result;
  double sum = 0.0;
  for (const MetricValues* values : samples) {
    const std::optional<double>& value = (*values)[metric];
    if (!value && !missing_is_zero) continue;
    sum += value.value_or(0.0);
    ++result.samples;
  }
  if (result.samples > 0) result.mean = sum / static_cast<double>(result.samples);
  return result;
}

Target make_target(const manifests::SampleRecord& record, double mask_area_px) {
  Target target;
  target.keypoints = unit::crop_keypoints(record);
  target.normalised_by_mask = mask_area_px > 0.0;
  if (target.normalised_by_mask) target.normaliser_px = std::sqrt(mask_area_px);
  if (record.truth && record.truth->has_keypoints_3d) target.keypoints_3d = record.truth->keypoints_3d;
  return target;
}

MetricValues measure(const device::BodyPrediction& body, const device::BodyMesh* mesh, const Target& target) {
  const double normaliser = target.normaliser_px;
  MetricValues values;
  values[index_of(Metric::auc)] = percent(filters::auc(body.keypoints_2d, target.keypoints, normaliser));
  values[index_of(Metric::pck_10)] =
      percent(filters::pck(body.keypoints_2d, target.keypoints, normaliser, 0.10));
  values[index_of(Metric::pck_15)] =
      percent(filters::pck(body.keypoints_2d, target.keypoints, normaliser, 0.15));
  values[index_of(Metric::l_proj)] = filters::projection_error(body.keypoints_2d, target.keypoints);
  if (target.keypoints_3d) {
    values[index_of(Metric::pa_mpjpe)] =
        filters::procrustes_error_mm(body.keypoints_3d, *target.keypoints_3d);
  }
  if (!target.vertices.empty()) {
    if (mesh == nullptr) throw std::logic_error("measure: the target has a mesh and the prediction has none");
    values[index_of(Metric::pa_mpvpe)] = filters::procrustes_error_mm(mesh->vertices, target.vertices);
  }
  return values;
}

void add_true_meshes(std::span<const manifests::SampleRecord* const> records,
                     const device::BodyMeshes& meshes, std::span<Target> targets) {
  std::vector<smal::Body> bodies;
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const auto& truth = records[i]->truth;
    if (!truth || !truth->has_pose || !truth->has_betas) continue;
    bodies.push_back({.pose = smal::rotation_matrices(truth->pose_axis_angle), .betas = truth->betas});
    positions.push_back(i);
  }
  std::vector<device::BodyMesh> posed = meshes.pose(bodies);
  for (std::size_t j = 0; j < posed.size(); ++j) {
    Target& target = targets[positions[j]];
    target.vertices = std::move(posed[j].vertices);
    if (!target.keypoints_3d) target.keypoints_3d = posed[j].keypoints_3d;
  }
}

}  // namespace q3d::pipeline::evaluation
