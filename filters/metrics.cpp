#include "filters/metrics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "smal/camera.h"

namespace q3d::filters {
namespace {

constexpr int kAucThresholds = 100;

struct Offset {
  double dx = 0.0;
  double dy = 0.0;
  double weight = 0.0;
};

Offset offset_of(const smal::CropPoint& projected, const smal::CropKeypoint& annotated) {
  return {double{projected.x} - double{annotated.x}, double{projected.y} - double{annotated.y},
          double{annotated.weight}};
}

using Points = Eigen::Matrix<double, 3, Eigen::Dynamic>;

Points to_points(std::span<const float> values) {
  const auto count = static_cast<Eigen::Index>(values.size() / 3);
  return Eigen::Map<const Eigen::Matrix<float, 3, Eigen::Dynamic>>(values.data(), 3, count).cast<double>();
}

void check_points(std::span<const float> predicted, std::span<const float> truth) {
  if (predicted.size() != truth.size() || predicted.empty() || predicted.size() % 3 != 0) {
    throw std::invalid_argument("points: got " + std::to_string(predicted.size()) + " predicted and " +
                                std::to_string(truth.size()) + " true numbers, expected 3 N of each, N > 0");
  }
}

// The orthogonal Procrustes problem with scale. The sign of the last singular vector keeps the rotation
// proper: a mirrored animal must not count as a good one.
Points align(const Points& predicted, const Points& truth) {
  const Eigen::Vector3d from = predicted.rowwise().mean();
  const Eigen::Vector3d to = truth.rowwise().mean();
  const Points centred = predicted.colwise() - from;
  const Eigen::Matrix3d covariance = centred * (truth.colwise() - to).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) flip(2, 2) = -1;
  const Eigen::Matrix3d rotation = svd.matrixV() * flip * svd.matrixU().transpose();
  const double spread = centred.squaredNorm();
  // If all points coincide, there is no extent to scale.
  const double scale = spread > 0 ? (rotation * covariance).trace() / spread : 0.0;
  return (scale * rotation * centred).colwise() + to;
}

}  // namespace

std::optional<double> projection_error(const smal::CropPoints& projected,
                                       const smal::CropKeypoints& annotated) {
  double sum = 0.0;
  int visible = 0;
  for (std::size_t k = 0; k < projected.size(); ++k) {
    const Offset offset = offset_of(projected[k], annotated[k]);
    if (!(offset.weight > 0)) continue;
    sum += std::abs(offset.dx) + std::abs(offset.dy);
    ++visible;
  }
  if (visible == 0) return std::nullopt;
  return sum / (2.0 * visible);
}

std::optional<double> pck(const smal::CropPoints& projected, const smal::CropKeypoints& annotated,
                          double normaliser_px, double threshold) {
  double hit_weight = 0.0;
  double total_weight = 0.0;
  for (std::size_t k = 0; k < projected.size(); ++k) {
    const Offset offset = offset_of(projected[k], annotated[k]);
    if (!(offset.weight > 0)) continue;
    total_weight += offset.weight;
    const double distance_px = smal::kCropSidePx * std::hypot(offset.dx, offset.dy);
    // Without a mask area the ratio is infinite, or 0 / 0 = NaN: no hit either way.
    if (distance_px / normaliser_px < threshold) hit_weight += offset.weight;
  }
  if (total_weight == 0.0) return std::nullopt;
  return hit_weight / total_weight;
}

std::optional<double> auc(const smal::CropPoints& projected, const smal::CropKeypoints& annotated,
                          double normaliser_px) {
  constexpr double kStep = 1.0 / (kAucThresholds - 1);
  double area = 0.0;
  double previous = 0.0;
  for (int i = 0; i < kAucThresholds; ++i) {
    const auto value = pck(projected, annotated, normaliser_px, i * kStep);
    if (!value) return std::nullopt;
    if (i > 0) area += kStep * (previous + *value) / 2.0;
    previous = *value;
  }
  return area;
}

std::vector<double> procrustes_align(std::span<const float> predicted, std::span<const float> truth) {
  check_points(predicted, truth);
  const Points aligned = align(to_points(predicted), to_points(truth));
  return {aligned.data(), aligned.data() + aligned.size()};
}

double procrustes_error_mm(std::span<const float> predicted, std::span<const float> truth) {
  check_points(predicted, truth);
  const Points from = to_points(predicted);
  const Points to = to_points(truth);
  if (!from.allFinite() || !to.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  return 1000.0 * (align(from, to) - to).colwise().norm().mean();
}

}  // namespace q3d::filters
