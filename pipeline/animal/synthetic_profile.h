// Outlines of the synthetic quadruped's body and of the tubes that grow out of it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "pipeline/animal/synthetic_anatomy.h"
#include "pipeline/animal/synthetic_mesh.h"

namespace q3d::pipeline::animal {

// A smooth curve through knots. It consists of cubic Hermite pieces; the slope at a knot is that of the
// parabola through the knot and its two neighbours.
class SmoothCurve {
 public:
  // Positions must increase strictly. values: (knots, channels).
  SmoothCurve(std::vector<double> positions, Eigen::MatrixXd values);
  Eigen::VectorXd at(double position) const;

 private:
  std::vector<double> positions_;
  Eigen::MatrixXd values_;
  Eigen::MatrixXd slopes_;
};

// One ring of the body, in the plane through its back and belly points.
struct BodyRing {
  Eigen::Vector3d back, belly;
  double half_width;
  double level;  // height at which it is widest: -1 at the belly, 0 in the middle, 1 at the back
};

struct BodyProfile {
  std::vector<BodyRing> rings;  // kBodyRings
  Eigen::Vector3d rear_pole, front_pole;
};

BodyProfile body_profile(const Anatomy& anatomy);

// One ring of a tube: center + across cos(phi) + along (sin(phi) + level cos(phi)^2). phi = 0 is the middle
// of the hole's first side, a quarter turn that of its last ring.
struct TubeRing {
  Eigen::Vector3d center, across, along;
  double level = 0.0;  // as in BodyRing
};

struct TubeProfile {
  std::vector<TubeRing> rings;
  Eigen::Vector3d pole;
};

// `root` is the centre of the hole's border on the body, and `body` the body that it was cut from.
TubeProfile tube_profile(const Tube& tube, const Anatomy& anatomy, const BodyProfile& body,
                         const Eigen::Vector3d& root);

// Returns the y of the ground on which the feet stand.
double ground_height(const Anatomy& anatomy);

}  // namespace q3d::pipeline::animal
