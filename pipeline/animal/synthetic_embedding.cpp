#include "pipeline/animal/synthetic_embedding.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "pipeline/animal/synthetic_profile.h"

namespace q3d::pipeline::animal {
namespace {

using Eigen::Vector3d;

// Exponents below 1 square the cross-section a little, as ribs and haunches do.
double squared_off(double value, double exponent) {
  return std::copysign(std::pow(std::abs(value), exponent), value);
}

void place_body(const QuadrupedMesh& mesh, const BodyProfile& profile, Points& points) {
  constexpr double kSquareness = 0.92;
  points.row(mesh.rear_pole) = profile.rear_pole;
  points.row(mesh.pole_of(Part::body)) = profile.front_pole;
  const auto& rings = mesh.rings_of(Part::body);
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const BodyRing& ring = profile.rings[r];
    const Vector3d center = (ring.back + ring.belly) / 2;
    const Vector3d half = (ring.back - ring.belly) / 2;
    for (std::size_t side = 0; side < rings[r].size(); ++side) {
      if (rings[r][side] < 0) continue;
      const double angle = 2.0 * M_PI * static_cast<double>(side) / kBodySides;
      const double up = squared_off(std::cos(angle), kSquareness);
      const double out = squared_off(std::sin(angle), kSquareness);
      points.row(rings[r][side]) =
          center + (up + ring.level * out * out) * half + out * ring.half_width * Vector3d::UnitZ();
    }
  }
}

// Returns angles around a tube at which the corners of its hole lie on the diagonals.
std::vector<double> ring_angles(const Hole& hole) {
  std::vector<double> angles;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const int steps = quarter % 2 == 0 ? hole.length() : hole.width();
    for (int step = 0; step < steps; ++step) {
      angles.push_back((quarter - 0.5 + static_cast<double>(step) / steps) * M_PI / 2);
    }
  }
  return angles;
}

Vector3d border_center(const QuadrupedMesh& mesh, const Hole& hole, const Points& points) {
  Vector3d sum = Vector3d::Zero();
  for (const int vertex : border_vertices(mesh, hole)) sum += points.row(vertex).transpose();
  return sum / hole.border();
}

void place_tube(const QuadrupedMesh& mesh, const Tube& tube, const Anatomy& anatomy, const BodyProfile& body,
                Points& points) {
  const TubeProfile profile = tube_profile(tube, anatomy, body, border_center(mesh, tube.hole, points));
  const std::vector<double> angles = ring_angles(tube.hole);
  const auto& rings = mesh.rings_of(tube.part);
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const TubeRing& ring = profile.rings[r];
    for (std::size_t side = 0; side < rings[r].size(); ++side) {
      const double c = std::cos(angles[side]);
      points.row(rings[r][side]) =
          ring.center + c * ring.across + (std::sin(angles[side]) + ring.level * c * c) * ring.along;
    }
  }
  points.row(mesh.pole_of(tube.part)) = profile.pole;
}

// The width of the smoothed seams, in edges. The seams of small tubes are narrower, so that the tubes keep
// their shape.
constexpr int kSeamReach = 4;
int first_step(Part part) {
  return part == Part::right_foreleg || part == Part::right_hindleg ? 0 : 2;
}

// Returns for each vertex the number of edges to the nearest border of a hole, at most kSeamReach.
std::vector<int> steps_from_holes(const QuadrupedMesh& mesh) {
  std::vector<int> steps(mesh.vertices.size(), kSeamReach);
  std::deque<int> front;
  for (const Tube& tube : kTubes) {
    for (const int vertex : border_vertices(mesh, tube.hole)) {
      for (const int v : {vertex, mesh.mirror[static_cast<std::size_t>(vertex)]}) {
        int& step = steps[static_cast<std::size_t>(v)];
        step = std::min(step, first_step(tube.part));
        front.push_back(v);
      }
    }
  }
  while (!front.empty()) {
    const int at = front.front();
    front.pop_front();
    const int next = steps[static_cast<std::size_t>(at)] + 1;
    for (const int neighbour : mesh.neighbours[static_cast<std::size_t>(at)]) {
      if (next < steps[static_cast<std::size_t>(neighbour)]) {
        steps[static_cast<std::size_t>(neighbour)] = next;
        front.push_back(neighbour);
      }
    }
  }
  return steps;
}

// Rounds the seams between the body and its tubes by moving vertices towards the mean of their neighbours.
void smooth_seams(const QuadrupedMesh& mesh, Points& points) {
  constexpr int kPasses = 14;
  const std::vector<int> steps = steps_from_holes(mesh);
  for (int pass = 0; pass < kPasses; ++pass) {
    Points next = points;
    for (std::size_t v = 0; v < steps.size(); ++v) {
      if (steps[v] >= kSeamReach) continue;
      Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
      for (const int neighbour : mesh.neighbours[v]) mean += points.row(neighbour);
      mean /= static_cast<double>(mesh.neighbours[v].size());
      const double pull = 0.5 * (1.0 - static_cast<double>(steps[v]) / kSeamReach);
      const auto row = static_cast<Eigen::Index>(v);
      next.row(row) += pull * (mean - points.row(row));
    }
    points = next;
  }
}

// Makes the left half an exact mirror image of the right one, and moves the middle to z = 0.
void mirror_right_half(const QuadrupedMesh& mesh, Points& points) {
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto here = static_cast<Eigen::Index>(v);
    const int other = mesh.mirror[v];
    if (other == here) points(here, 2) = 0.0;
    if (mesh.half[v] > 0) points.row(other) << points(here, 0), points(here, 1), -points(here, 2);
  }
}

}  // namespace

Points embed_quadruped(const QuadrupedMesh& mesh, const Anatomy& anatomy) {
  Points points = Points::Zero(static_cast<Eigen::Index>(mesh.vertices.size()), 3);
  const BodyProfile body = body_profile(anatomy);
  place_body(mesh, body, points);
  for (const Tube& tube : kTubes) place_tube(mesh, tube, anatomy, body, points);
  mirror_right_half(mesh, points);
  smooth_seams(mesh, points);
  mirror_right_half(mesh, points);
  return points;
}

}  // namespace q3d::pipeline::animal
