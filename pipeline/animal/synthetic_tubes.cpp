// Makes the tubes of the synthetic quadruped: legs, tail, jaw and ears.
#include <Eigen/Geometry>
#include <cmath>

#include "pipeline/animal/synthetic_profile.h"

namespace q3d::pipeline::animal {
namespace {

using Eigen::Vector3d;

// A knot of a tube: the centre, and the half sizes across and along.
struct Knot {
  double ring;
  Vector3d center;
  double across, along;
};

SmoothCurve curve_through(const std::vector<Knot>& knots) {
  std::vector<double> positions;
  Eigen::MatrixXd values(static_cast<Eigen::Index>(knots.size()), 5);
  for (const Knot& knot : knots) {
    values.row(static_cast<Eigen::Index>(positions.size())) << knot.center.transpose(), knot.across,
        knot.along;
    positions.push_back(knot.ring);
  }
  return {positions, values};
}

// Makes rings at the positions 0, 1, ... of the curve. They extend along `across_axis` and are perpendicular
// to the curve in the plane of symmetry.
TubeProfile rings_along(const std::vector<Knot>& knots, int rings, const Vector3d& across_axis,
                        const Vector3d& pole) {
  const SmoothCurve curve = curve_through(knots);
  TubeProfile profile;
  for (int ring = 0; ring < rings; ++ring) {
    const Eigen::VectorXd here = curve.at(ring);
    const Vector3d tangent = (curve.at(ring + 0.5) - curve.at(ring - 0.5)).head<3>();
    const Vector3d along = across_axis.cross(tangent).normalized();
    profile.rings.push_back({here.head<3>(), here[3] * across_axis, here[4] * along, 0.0});
  }
  profile.pole = pole;
  return profile;
}

// A knot of a leg. The tilt of the ring's plane is given, from level (0, the leg points down) to upright (pi
// / 2, it points forwards). Planes perpendicular to the curve would fold thick rings into each other at a
// short foot.
struct LegKnot {
  double ring;
  Vector3d center;
  double across, along;
  double tilt;
};

TubeProfile leg_rings(const std::vector<LegKnot>& knots, int rings, const Vector3d& pole) {
  std::vector<double> positions;
  Eigen::MatrixXd values(static_cast<Eigen::Index>(knots.size()), 6);
  for (const LegKnot& knot : knots) {
    values.row(static_cast<Eigen::Index>(positions.size())) << knot.center.transpose(), knot.across,
        knot.along, knot.tilt;
    positions.push_back(knot.ring);
  }
  const SmoothCurve curve(positions, values);
  TubeProfile profile;
  for (int ring = 0; ring < rings; ++ring) {
    const Eigen::VectorXd here = curve.at(ring);
    const Vector3d along(std::cos(here[5]), std::sin(here[5]), 0.0);
    profile.rings.push_back({here.head<3>(), here[3] * Vector3d::UnitZ(), here[4] * along, 0.0});
  }
  profile.pole = pole;
  return profile;
}

// Adds the last rings of a leg: fetlock, heel, ball and toes, flat on the ground. Returns the pole.
Vector3d add_foot(const Anatomy& a, double first_ring, const Vector3d& fetlock, double cannon,
                  std::vector<LegKnot>& knots) {
  const double floor = ground_height(a);
  const auto at = [&](double share, double height) {
    return Vector3d(fetlock.x() + share * a.foot_length, floor + height * a.foot_height, fetlock.z());
  };
  const double half = a.foot_height / 2;
  knots.push_back({first_ring, fetlock, 0.54 * cannon, 0.54 * cannon, 0.15});
  knots.push_back(
      {first_ring + 2, at(0.16, 0.56), 0.46 * a.foot_width, 0.28 * a.foot_length + 0.4 * half, 0.60});
  knots.push_back({first_ring + 3, at(0.46, 0.46), 0.52 * a.foot_width, 1.00 * half, 1.10});
  knots.push_back({first_ring + 4, at(0.76, 0.32), 0.38 * a.foot_width, 0.60 * half, 1.40});
  return at(0.86, 0.24);
}

TubeProfile foreleg(const Tube& tube, const Anatomy& a, const BodyProfile& body, const Vector3d& root) {
  const double floor = ground_height(a);
  const double z = a.foreleg_distance / 2;
  const double x = body.rings[30].belly.x() - 0.03 * a.trunk_length;
  const double thick = a.elbow_thickness / 2;
  const double carpus_half = a.carpus_thickness / 2, cannon_half = a.fore_cannon_thickness / 2;
  const Vector3d elbow(x, floor + a.foreleg_length, z);
  const Vector3d carpus(x + 0.03, floor + 0.40 * a.foreleg_length, z);
  const Vector3d fetlock(x + 0.03, floor + a.foot_height + 0.06 * a.foreleg_length, z);
  std::vector<LegKnot> knots = {
      {0, 0.5 * (root + elbow + Vector3d(0, 0.06, 0)), 1.05 * thick, 1.35 * thick, 0.0},
      {3, elbow, 0.85 * thick, 1.05 * thick, 0.05},
      {6, 0.5 * (elbow + carpus) + Vector3d(0, 0.04 * a.foreleg_length, 0), 0.52 * thick + 0.34 * carpus_half,
       0.62 * thick + 0.30 * carpus_half, 0.08},
      {9, carpus, carpus_half, carpus_half, 0.0},
      {12, 0.5 * (carpus + fetlock), cannon_half, cannon_half, 0.0}};
  const Vector3d toe = add_foot(a, 14, fetlock, a.fore_cannon_thickness, knots);
  return leg_rings(knots, tube.rings, toe);
}

TubeProfile hindleg(const Tube& tube, const Anatomy& a, const BodyProfile& body, const Vector3d& root) {
  const double floor = ground_height(a);
  const double z = a.hindleg_distance / 2;
  const double hip_x = body.rings[5].back.x();
  const double flank_y = body.rings[8].belly.y();
  const double hock_y = floor + a.hock_height;
  const double reach = flank_y - hock_y;
  const double thigh = a.thigh_thickness / 2, knee = a.stifle_thickness / 2;
  const double hock_half = a.hock_thickness / 2, cannon_half = a.hind_cannon_thickness / 2;
  const Vector3d stifle(hip_x + 0.04 + 0.08 * reach, 0.64 * flank_y + 0.36 * hock_y, z);
  const Vector3d hock(hip_x - 0.03 - 0.12 * reach, hock_y, z);
  const Vector3d fetlock(hock.x() + 0.01 + 0.10 * a.hock_height, floor + a.foot_height + 0.10 * a.hock_height,
                         z);
  std::vector<LegKnot> knots = {
      {0, 0.8 * root + 0.2 * Vector3d(hip_x + 0.02, stifle.y(), z), 0.66 * thigh, 1.12 * thigh, 0.05},
      {2, 0.45 * root + 0.55 * stifle - Vector3d(0.16 * thigh, 0, 0), 0.66 * thigh, 0.92 * thigh, 0.05},
      {4, stifle - Vector3d(0.25 * knee, 0, 0), 0.85 * knee, 1.02 * knee, -0.12},
      {7, 0.5 * (stifle + hock), 0.40 * knee + 0.46 * hock_half, 0.46 * knee + 0.54 * hock_half, -0.38},
      {10, hock, 0.88 * hock_half, 1.10 * hock_half, -0.20},
      {12, 0.5 * (hock + fetlock), cannon_half, cannon_half, 0.05}};
  const Vector3d toe = add_foot(a, 14, fetlock, a.hind_cannon_thickness, knots);
  return leg_rings(knots, tube.rings, toe);
}

TubeProfile tail(const Tube& tube, const Anatomy& a, const Vector3d& root) {
  const Vector3d out(-std::cos(a.tail_droop), -std::sin(a.tail_droop), 0.0);
  const auto knot = [&](double ring, double share, double width) -> Knot {
    // The root leaves the rump a little flatter than the rest, so that the tail hangs in an arc.
    const Vector3d lift(
        0.0, 0.08 * a.tail_length * std::sin(M_PI * std::min(share, 1.0)) * std::sin(a.tail_droop), 0.0);
    return {ring, root + share * a.tail_length * out + lift, width / 2, width / 2};
  };
  const double middle = 0.5 * (a.tail_base_width + a.tail_tip_width);
  return rings_along(
      {knot(0, 0.04, 1.15 * a.tail_base_width), knot(2, 0.15, a.tail_base_width), knot(10, 0.57, middle),
       knot(17, 0.93, a.tail_tip_width), knot(18, 0.985, 0.6 * a.tail_tip_width)},
      tube.rings, -Vector3d::UnitZ(), knot(19, 1.0, 0).center);
}

// Makes the jaw, which hangs under the muzzle with a narrow gap below the mouth line.
TubeProfile jaw(const Tube& tube, const Anatomy& a, const BodyProfile& body) {
  const BodyRing& corner = body.rings[48];
  const BodyRing& front = body.rings[54];
  const Vector3d forward = (front.belly - corner.belly).normalized();
  const Vector3d up(-forward.y(), forward.x(), 0.0);
  const double length = 0.97 * (front.belly - corner.belly).norm();
  const double gap = 0.06 * a.jaw_depth;
  const auto knot = [&](double ring, double share, double depth, double width) -> Knot {
    return {ring, corner.belly + share * length * forward - (gap + depth / 2) * up, width / 2, depth / 2};
  };
  TubeProfile profile =
      rings_along({knot(0, 0.10, 1.35 * a.jaw_depth, 0.5 * (a.cranium_width * 0.75 + a.muzzle_width)),
                   knot(3, 0.45, 1.05 * a.jaw_depth, 0.92 * a.muzzle_width),
                   knot(6, 0.88, 0.85 * a.jaw_depth, 0.85 * a.nose_width),
                   knot(7, 0.97, 0.55 * a.jaw_depth, 0.55 * a.nose_width)},
                  tube.rings, Vector3d::UnitZ(), knot(8, 1.0, 0.55 * a.jaw_depth, 0).center);
  for (TubeRing& ring : profile.rings) ring.level = 0.6;  // flat on top, as the muzzle is below
  return profile;
}

TubeProfile ear(const Tube& tube, const Anatomy& a, const BodyProfile& body, const Vector3d& root) {
  const BodyRing& crown = body.rings[44];
  const Vector3d upright = (crown.back - crown.belly).normalized();
  const Vector3d side = Vector3d::UnitZ();
  const Vector3d out = std::cos(a.ear_spread) * upright + std::sin(a.ear_spread) * side;
  const Vector3d across =
      std::sin(a.ear_spread) * upright - std::cos(a.ear_spread) * side;  // towards the middle
  const Vector3d along = across.cross(out);
  const double shares[] = {0.08, 0.26, 0.46, 0.66, 0.84, 0.95};
  const double widths[] = {0.95, 1.00, 0.94, 0.76, 0.48, 0.24};
  TubeProfile profile;
  for (int ring = 0; ring < tube.rings; ++ring) {
    const double half = widths[ring] * a.ear_width / 2;
    // The flat of the ear faces forwards and outwards: wide across, thin along.
    profile.rings.push_back(
        {root + shares[ring] * a.ear_length * out, half * across, 0.30 * half * along, 0.0});
  }
  profile.pole = root + a.ear_length * out;
  return profile;
}

}  // namespace

TubeProfile tube_profile(const Tube& tube, const Anatomy& anatomy, const BodyProfile& body,
                         const Vector3d& root) {
  switch (tube.part) {
    case Part::right_foreleg:
      return foreleg(tube, anatomy, body, root);
    case Part::right_hindleg:
      return hindleg(tube, anatomy, body, root);
    case Part::tail:
      return tail(tube, anatomy, root);
    case Part::jaw:
      return jaw(tube, anatomy, body);
    default:
      return ear(tube, anatomy, body, root);
  }
}

}  // namespace q3d::pipeline::animal
