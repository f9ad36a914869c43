#include "pipeline/animal/synthetic_skeleton.h"

#include <cmath>

namespace q3d::pipeline::animal {
namespace {

constexpr double kTailBone = 18.0 / 7.0;  // rings for each bone of the tail

// Adds the mean of some vertices of a ring to a row of the regressor.
void add_mean(const std::vector<int>& vertices, double weight, Eigen::MatrixXd& regressor, int joint) {
  for (const int vertex : vertices) regressor(joint, vertex) += weight / static_cast<double>(vertices.size());
}

// Returns a ring's vertices. In a body ring with a hole, only pairs at equal heights above and below its
// middle are used, so that their mean stays at the ring's centre.
std::vector<int> ring_vertices(const QuadrupedMesh& mesh, Part part, int ring) {
  const auto& row = mesh.rings_of(part)[static_cast<std::size_t>(ring)];
  if (part != Part::body) return row;
  std::vector<int> vertices;
  for (int side = 0; side < kBodySides; ++side) {
    const int opposite = mesh.body_vertex(ring, kBodySides / 2 - side);
    if (mesh.body_vertex(ring, side) >= 0 && opposite >= 0) vertices.push_back(mesh.body_vertex(ring, side));
  }
  return vertices;
}

// Returns the vertices of the sides [first, last] of a body ring on the right of the back, or their mirror
// images.
std::vector<int> flank_vertices(const QuadrupedMesh& mesh, int ring, int first, int last, bool left) {
  std::vector<int> vertices;
  for (int side = first; side <= last; ++side)
    vertices.push_back(mesh.body_vertex(ring, left ? -side : side));
  return vertices;
}

void add_ring(const QuadrupedMesh& mesh, const JointSpec& spec, double weight, Eigen::MatrixXd& regressor,
              int joint) {
  const int lower = static_cast<int>(std::floor(spec.ring));
  const double above = spec.ring - lower;
  add_mean(ring_vertices(mesh, spec.part, lower), weight * (1.0 - above), regressor, joint);
  if (above > 0.0) add_mean(ring_vertices(mesh, spec.part, lower + 1), weight * above, regressor, joint);
}

}  // namespace

const std::array<JointSpec, smal::kNumJoints>& synthetic_joints() {
  static constexpr std::array<JointSpec, smal::kNumJoints> kJoints = {{
      {"root", -1, Part::body, 5, 0},  // 0: hips
      {"spine_1", 0, Part::body, 8, 2.5},
      {"spine_2", 1, Part::body, 12, 3},
      {"spine_3", 2, Part::body, 16, 3},
      {"spine_4", 3, Part::body, 20, 3},
      {"spine_5", 4, Part::body, 25, 4},
      {"spine_6", 5, Part::body, 30, 4},  // 6: withers
      {"left_shoulder", 6, Part::left_foreleg, 0, 0},
      {"left_elbow", 7, Part::left_foreleg, 3, 2.2},
      {"left_carpus", 8, Part::left_foreleg, 9, 2},
      {"left_fore_foot", 9, Part::left_foreleg, 14, 1.6},
      {"right_shoulder", 6, Part::right_foreleg, 0, 0},  // 11
      {"right_elbow", 11, Part::right_foreleg, 3, 2.2},
      {"right_carpus", 12, Part::right_foreleg, 9, 2},
      {"right_fore_foot", 13, Part::right_foreleg, 14, 1.6},
      {"neck", 6, Part::body, 34, 4},  // 15
      {"head", 15, Part::body, 42, 3.5},
      {"left_hip", 0, Part::left_hindleg, 0, 0},  // 17
      {"left_stifle", 17, Part::left_hindleg, 4, 2.4},
      {"left_hock", 18, Part::left_hindleg, 10, 1.8},
      {"left_hind_foot", 19, Part::left_hindleg, 14, 1.4},
      {"right_hip", 0, Part::right_hindleg, 0, 0},  // 21
      {"right_stifle", 21, Part::right_hindleg, 4, 2.4},
      {"right_hock", 22, Part::right_hindleg, 10, 1.8},
      {"right_hind_foot", 23, Part::right_hindleg, 14, 1.4},
      {"tail_1", 0, Part::tail, 0, 0},  // 25
      {"tail_2", 25, Part::tail, kTailBone, 1.4},
      {"tail_3", 26, Part::tail, 2 * kTailBone, 1.4},
      {"tail_4", 27, Part::tail, 3 * kTailBone, 1.4},
      {"tail_5", 28, Part::tail, 4 * kTailBone, 1.4},
      {"tail_6", 29, Part::tail, 5 * kTailBone, 1.4},
      {"tail_7", 30, Part::tail, 6 * kTailBone, 1.4},
      {"jaw", 16, Part::jaw, 0, 0},  // 32
      {"left_ear", 16, Part::left_ear, 0, 0},
      {"right_ear", 16, Part::right_ear, 0, 0},
  }};
  return kJoints;
}

Eigen::MatrixXd joint_regressor(const QuadrupedMesh& mesh) {
  Eigen::MatrixXd regressor =
      Eigen::MatrixXd::Zero(smal::kNumJoints, static_cast<Eigen::Index>(mesh.vertices.size()));
  for (int joint = 0; joint < smal::kNumJoints; ++joint) {
    const JointSpec& spec = synthetic_joints()[static_cast<std::size_t>(joint)];
    const bool foreleg = spec.part == Part::left_foreleg || spec.part == Part::right_foreleg;
    const bool hindleg = spec.part == Part::left_hindleg || spec.part == Part::right_hindleg;
    if (spec.part == Part::jaw) {  // its hinge: low on both cheeks
      for (const bool left : {false, true})
        add_mean(flank_vertices(mesh, 45, 11, 12, left), 0.5, regressor, joint);
    } else if ((foreleg || hindleg) && spec.ring == 0) {
      // Shoulders and hips lie inside the trunk, half way between the limb's first ring and the flank above
      // it.
      const bool left = spec.part == Part::left_foreleg || spec.part == Part::left_hindleg;
      add_ring(mesh, spec, 0.5, regressor, joint);
      add_mean(flank_vertices(mesh, foreleg ? 30 : 5, 4, 8, left), 0.5, regressor, joint);
    } else {
      add_ring(mesh, spec, 1.0, regressor, joint);
    }
  }
  return regressor;
}

std::vector<std::vector<std::int64_t>> keypoint_groups(const QuadrupedMesh& mesh) {
  std::vector<std::vector<std::int64_t>> groups(smal::kNumKeypoints);
  const auto add = [&](std::size_t keypoint, Part part, int ring, const std::vector<int>& sides) {
    for (const int side : sides) {
      groups[keypoint].push_back(
          mesh.rings_of(part)[static_cast<std::size_t>(ring)][static_cast<std::size_t>(side)]);
    }
  };
  // Adds vertices to the right keypoint, and their mirror images to the left one.
  const auto add_pair = [&](std::size_t left, std::size_t right, Part part, int ring,
                            const std::vector<int>& sides) {
    add(right, part, ring, sides);
    groups[left].clear();
    for (const std::int64_t vertex : groups[right]) {
      groups[left].push_back(mesh.mirror[static_cast<std::size_t>(vertex)]);
    }
  };
  // Quarters of a foreleg ring (border 20), a hind leg ring (24), and a tail ring (12).
  const std::vector<int> around_fore = {2, 7, 12, 17}, around_hind = {3, 9, 15, 21},
                         around_tail = {1, 4, 7, 10};
  add_pair(0, 1, Part::body, 47, {5});
  add_pair(0, 1, Part::body, 48, {4, 5});
  add(2, Part::jaw, 6, {14, 15, 16});
  add(2, Part::jaw, 7, {15});
  add_pair(3, 4, Part::right_foreleg, 17, around_fore);
  add_pair(5, 6, Part::right_hindleg, 17, around_hind);
  add(7, Part::tail, 0, around_tail);
  add_pair(8, 9, Part::right_foreleg, 3, {1, 2, 3, 19});
  add_pair(10, 11, Part::right_hindleg, 4, {2, 3, 4, 23});
  add_pair(12, 13, Part::body, 29, {4, 5});
  add_pair(12, 13, Part::body, 30, {4, 5});
  add_pair(14, 15, Part::right_foreleg, 9, around_fore);
  add_pair(16, 17, Part::right_hindleg, 10, around_hind);
  add(18, Part::body, 40, {0, 1, 31});
  add(19, Part::tail, 18, around_tail);
  groups[19].push_back(mesh.pole_of(Part::tail));
  add_pair(20, 21, Part::right_ear, 2, {1, 4, 7, 10});
  add_pair(22, 23, Part::body, 48, {13});
  add_pair(22, 23, Part::body, 47, {13});
  add(24, Part::body, 55, {0, 4, 28});
  groups[24].push_back(mesh.pole_of(Part::body));
  add(25, Part::tail, 9, around_tail);
  return groups;
}

}  // namespace q3d::pipeline::animal
