#include "pipeline/world/shape_space.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

#include "pipeline/world/landmarks.h"

namespace q3d::pipeline::world {
namespace {

constexpr double kIndividual = 0.5;  // deviation of individuals from the species, in the family's deviations
constexpr double kFarthest = 3.0;    // largest distance of a species from its family, in such deviations

// The SMAL keypoints at the ends of the measured parts.
enum Keypoint {
  left_eye = 0,
  left_front_paw = 3,
  left_back_paw = 5,
  tail_base = 7,
  left_front_thigh = 8,
  left_back_thigh = 10,
  left_shoulder = 12,
  right_shoulder = 13,
  neck = 18,
  tail_tip = 19,
  nose = 24
};

// Returns one wanted change for each of ShapeSpace's lengths, in the same order.
Eigen::VectorXd wanted_changes(const Build& build) {
  Eigen::VectorXd changes(8);
  changes << build.legs, build.legs, build.neck, build.girth, build.girth, build.head, build.ears, build.tail;
  return changes;
}

int vertex_of(const std::vector<Landmark>& landmarks, const char* name) {
  return std::find_if(landmarks.begin(), landmarks.end(), [&](const Landmark& l) { return l.name == name; })
      ->vertex;
}

// Returns where the ear grows out of the head, which is its vertex nearest to the eye.
int ear_root(const RestMesh& rest) {
  constexpr std::size_t kLeftEarJoint = 33;
  Eigen::Vector3f eye = Eigen::Vector3f::Zero();
  for (const int v : rest.keypoint_vertices[left_eye]) eye += rest.vertices[static_cast<std::size_t>(v)];
  eye /= static_cast<float>(rest.keypoint_vertices[left_eye].size());
  int best = -1;
  float best_distance = 1e9F;
  for (std::size_t v = 0; v < rest.vertices.size(); ++v) {
    const float distance = (rest.vertices[v] - eye).norm();
    if (rest.skinning[v][kLeftEarJoint] > 0.5F && distance < best_distance) {
      best_distance = distance;
      best = static_cast<int>(v);
    }
  }
  return best;
}

}  // namespace

ShapeSpace::ShapeSpace(const RestMesh& rest, Eigen::MatrixXd shape_directions, Eigen::MatrixXd family_means,
                       std::vector<Eigen::MatrixXd> family_factors)
    : directions_(std::move(shape_directions)),
      family_means_(std::move(family_means)),
      family_factors_(std::move(family_factors)) {
  const auto& points = rest.keypoint_vertices;
  const auto landmarks = superanimal_landmarks(rest);
  std::vector<int> withers = points[left_shoulder];
  withers.insert(withers.end(), points[right_shoulder].begin(), points[right_shoulder].end());
  const auto surface = [&](const char* name) { return std::vector<int>{vertex_of(landmarks, name)}; };
  lengths_ = {between(rest, points[left_front_thigh], points[left_front_paw]),
              between(rest, points[left_back_thigh], points[left_back_paw]),
              between(rest, withers, points[neck]),
              between(rest, surface("back_middle"), surface("belly_bottom")),
              between(rest, surface("body_middle_left"), surface("body_middle_right")),
              between(rest, points[left_eye], points[nose]),
              between(rest, {ear_root(rest)}, surface("left_earend")),
              between(rest, points[tail_base], points[tail_tip])};
}

ShapeSpace::Length ShapeSpace::between(const RestMesh& rest, const std::vector<int>& from,
                                       const std::vector<int>& to) const {
  const auto mean = [&](const std::vector<int>& group) {
    std::pair<Eigen::Vector3d, Eigen::MatrixXd> sum{Eigen::Vector3d::Zero(),
                                                    Eigen::MatrixXd::Zero(3, directions_.cols())};
    for (const int v : group) {
      sum.first += rest.vertices[static_cast<std::size_t>(v)].cast<double>();
      sum.second += directions_.middleRows(3 * v, 3);
    }
    const auto count = static_cast<double>(group.size());
    return std::pair<Eigen::Vector3d, Eigen::MatrixXd>(sum.first / count, sum.second / count);
  };
  const auto a = mean(from), b = mean(to);
  return {a.first, b.first, a.second, b.second};
}

Eigen::VectorXd ShapeSpace::typical(const Species& species) const {
  const Eigen::VectorXd mean = family_means_.row(static_cast<int>(species.family)).transpose();
  const Eigen::MatrixXd& factor = family_factors_[static_cast<std::size_t>(species.family)];
  const Eigen::VectorXd wanted = wanted_changes(species.build);
  // The relative change of each length for one deviation of each measure, at the family's mean.
  Eigen::MatrixXd slope(wanted.size(), factor.rows());
  for (Eigen::Index i = 0; i < wanted.size(); ++i) {
    const Length& length = lengths_[static_cast<std::size_t>(i)];
    const Eigen::Vector3d span =
        (length.to + length.to_directions * mean) - (length.from + length.from_directions * mean);
    const Eigen::RowVectorXd gradient =
        span.transpose() * (length.to_directions - length.from_directions) / span.squaredNorm();
    slope.row(i) = gradient * factor.transpose();
  }
  // The ridge keeps the solution small for builds that the space cannot represent exactly.
  const Eigen::MatrixXd gram =
      slope * slope.transpose() + 1e-4 * Eigen::MatrixXd::Identity(wanted.size(), wanted.size());
  const Eigen::VectorXd measures = slope.transpose() * gram.ldlt().solve(wanted);
  return mean + factor.transpose() * measures.cwiseMax(-kFarthest).cwiseMin(kFarthest);
}

std::array<float, smal::kNumBetas> ShapeSpace::draw(const Species& species, manifests::Rng& rng) const {
  const Eigen::MatrixXd& factor = family_factors_[static_cast<std::size_t>(species.family)];
  Eigen::VectorXd measures(factor.rows());
  for (double& measure : measures) measure = kIndividual * std::clamp(rng.normal(), -2.5, 2.5);
  const Eigen::VectorXd drawn = typical(species) + factor.transpose() * measures;
  std::array<float, smal::kNumBetas> betas{};
  std::copy(drawn.begin(), drawn.end(), betas.begin());
  return betas;
}

}  // namespace q3d::pipeline::world
