#include "pipeline/world/subject.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace q3d::pipeline::world {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

Eigen::Matrix3d about(const Eigen::Vector3d& axis, double radians) {
  return Eigen::AngleAxisd(radians, axis).toRotationMatrix();
}

// Draws the angle about the vertical between the animal's axis and the picture. At 0 the animal is seen from
// its right, with its head to the right.
double draw_yaw(double side_view, manifests::Rng& rng) {
  const double side = rng.chance(0.5) ? 0.0 : std::numbers::pi;
  return rng.chance(side_view) ? side + rng.normal(0.0, 26.0) * kDegree
                               : rng.uniform(-std::numbers::pi, std::numbers::pi);
}

Place draw_place(const std::array<double, kPlaces>& weights, manifests::Rng& rng) {
  double total = 0.0;
  for (const double weight : weights) total += weight;
  double left = rng.uniform() * total;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    left -= weights[i];
    if (left < 0.0) return static_cast<Place>(i);
  }
  return Place::meadow;
}

}  // namespace

Subject draw_subject(const Species& species, const Domain& domain, const ShapeSpace& shapes,
                     manifests::Rng& who, manifests::Rng& when) {
  Subject subject;
  subject.posture.betas = shapes.draw(species, who);
  subject.coat = draw_coat(species, who);
  for (int axis = 0; axis < 3; ++axis) subject.individual[axis] = static_cast<float>(who.uniform(0.0, 200.0));
  subject.place = draw_place(domain.places, who);

  const Stance stance = draw_stance(domain.stance, when);
  subject.posture.pose = stance.pose;
  subject.lift = stance.lift;

  // Map body axes (x to the head, y up, z right) to camera axes (x right, y down, z forward). At yaw 0 the
  // animal is seen from its right. Then the camera moves up by `high` and tilts by `roll`.
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  const double high =
      std::clamp(when.normal(domain.camera_high_deg, domain.camera_high_spread_deg), -4.0, 50.0) * kDegree;
  const double roll = std::clamp(when.normal(0.0, 2.5), -8.0, 8.0) * kDegree;
  const Eigen::Matrix3d camera = about(z, roll) * about(x, high);
  const Eigen::Matrix3d to_camera = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  const Eigen::Matrix3d tilt = about(z, stance.pitch) * about(x, stance.roll);
  const Eigen::AngleAxisd orientation(
      Eigen::Matrix3d(camera * about(y, draw_yaw(domain.side_view, when)) * to_camera * tilt));
  const Eigen::Vector3d global = orientation.angle() * orientation.axis();
  for (int axis = 0; axis < 3; ++axis) {
    subject.posture.pose[static_cast<std::size_t>(axis)] = static_cast<float>(global[axis]);
  }
  subject.up = (camera * -y).cast<float>();
  return subject;
}

}  // namespace q3d::pipeline::world
