#include "pipeline/world/shape_space.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

#include "pipeline/world/landmarks.h"

namespace q3d::pipeline::world {
namespace {

constexpr float kIndividual = 0.5F;   // deviation of an individual from its species, in family deviations
constexpr float kFarthest = 3.0F;     // of a species from its family, in family deviations

// SMAL keypoints that end the measured parts.
enum Keypoint {
  left_eye = 0, left_front_paw = 3, left_back_paw = 5, tail_base = 7, left_front_thigh = 8, left_back_thigh = 10,
  left_shoulder = 12, right_shoulder = 13, neck = 18, tail_tip = 19, nose = 24
};

// One wanted change for each of ShapeSpace's lengths, in the same order.
Eigen::VectorXf wanted_changes(const Build& build) {
  Eigen::VectorXf changes(8);
  changes << build.legs, build.legs, build.neck, build.girth, build.girth, build.head, build.ears, build.tail;
  return changes;
}

int vertex_of(const std::vector<Landmark>& landmarks, const char* name) {
  return std::find_if(landmarks.begin(), landmarks.end(), [&](const Landmark& l) { return l.name == name; })->vertex;
}

// Where the ear grows out of the head: its vertex nearest to the eye.
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

ShapeSpace::ShapeSpace(const RestMesh& rest, Eigen::MatrixXf shape_directions, Eigen::MatrixXf family_means,
                       Eigen::VectorXf deviations)
    : directions_(std::move(shape_directions)),
      family_means_(std::move(family_means)),
      deviations_(std::move(deviations)) {
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
    std::pair<Eigen::Vector3f, Eigen::MatrixXf> sum{Eigen::Vector3f::Zero(),
                                                    Eigen::MatrixXf::Zero(3, directions_.cols())};
    for (const int v : group) {
      sum.first += rest.vertices[static_cast<std::size_t>(v)];
      sum.second += directions_.middleRows(3 * v, 3);
    }
    const auto count = static_cast<float>(group.size());
    return std::pair<Eigen::Vector3f, Eigen::MatrixXf>(sum.first / count, sum.second / count);
  };
  const auto a = mean(from), b = mean(to);
  return {a.first, b.first, a.second, b.second};
}

Eigen::VectorXf ShapeSpace::typical(const Species& species) const {
  const Eigen::VectorXf mean = family_means_.row(static_cast<int>(species.family)).transpose();
  const Eigen::VectorXf wanted = wanted_changes(species.build);
  // Relative change of each length for one deviation of each beta, at the family's mean.
  Eigen::MatrixXf slope(wanted.size(), mean.size());
  for (Eigen::Index i = 0; i < wanted.size(); ++i) {
    const Length& length = lengths_[static_cast<std::size_t>(i)];
    const Eigen::Vector3f span =
        (length.to + length.to_directions * mean) - (length.from + length.from_directions * mean);
    const Eigen::RowVectorXf gradient =
        span.transpose() * (length.to_directions - length.from_directions) / span.squaredNorm();
    slope.row(i) = gradient.cwiseProduct(deviations_.transpose());
  }
  // Smallest change in deviations; the ridge keeps builds that the space cannot quite give from exploding.
  const Eigen::MatrixXf gram =
      slope * slope.transpose() + 1e-4F * Eigen::MatrixXf::Identity(wanted.size(), wanted.size());
  const Eigen::VectorXf change = slope.transpose() * gram.ldlt().solve(wanted);
  return mean + change.cwiseMax(-kFarthest).cwiseMin(kFarthest).cwiseProduct(deviations_);
}

std::array<float, kBodyBetas> ShapeSpace::draw(const Species& species, Rng& rng) const {
  const Eigen::VectorXf middle = typical(species);
  std::array<float, kBodyBetas> betas{};
  for (std::size_t i = 0; i < betas.size(); ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    betas[i] = middle[index] + kIndividual * deviations_[index] *
                                   static_cast<float>(std::clamp(rng.normal(), -2.5, 2.5));
  }
  return betas;
}

}  // namespace q3d::pipeline::world
