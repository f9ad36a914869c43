#include "smal/synthetic_skeleton.h"

#include <algorithm>
#include <cmath>

namespace q3d::smal {
namespace {

// Every side of a ring.
constexpr int kAllSides = -1;

// Some vertices of the mesh: sides [first_side, last_side] of a ring, which may lie between two rings.
struct Place {
  Part part;
  double ring;
  int first_side = kAllSides;
  int last_side = kAllSides;
};

struct WeightedPlace {
  Place place;
  double weight;
};

// Where the joints of the right half and the middle lie. The hips and shoulders are inside the trunk, half
// way between the limb's first ring and the flank above it.
std::vector<WeightedPlace> joint_places(int joint) {
  const auto body = [](double ring) -> std::vector<WeightedPlace> { return {{{Part::body, ring}, 1.0}}; };
  const auto tube = [](Part part, double ring) -> std::vector<WeightedPlace> {
    return {{{part, ring}, 1.0}};
  };
  switch (joint) {
    case 0:
      return body(5);
    case 1:
      return body(8);
    case 2:
      return body(12);
    case 3:
      return body(16);
    case 4:
      return body(20);
    case 5:
      return body(25);
    case 6:
      return body(30);
    case 11:
      return {{{Part::right_foreleg, 0}, 0.5}, {{Part::body, 30, 4, 8}, 0.5}};
    case 12:
      return tube(Part::right_foreleg, 3);
    case 13:
      return tube(Part::right_foreleg, 9);
    case 14:
      return tube(Part::right_foreleg, 14);
    case 15:
      return body(34);
    case 16:
      return body(42);
    case 21:
      return {{{Part::right_hindleg, 0}, 0.5}, {{Part::body, 5, 4, 8}, 0.5}};
    case 22:
      return tube(Part::right_hindleg, 4);
    case 23:
      return tube(Part::right_hindleg, 10);
    case 24:
      return tube(Part::right_hindleg, 14);
    // The jaw's hinge: low on both cheeks.
    case 32:
      return {{{Part::body, 45, 11, 12}, 0.5}, {{Part::body, 45, 20, 21}, 0.5}};
    case 34:
      return tube(Part::right_ear, 0);
    default:
      return tube(Part::tail, (joint - 25) * 18.0 / 7.0);
  }
}

// The joint on the other side; middle joints are their own.
int mirror_joint(int joint) {
  if (joint >= 7 && joint <= 14) return joint <= 10 ? joint + 4 : joint - 4;
  if (joint >= 17 && joint <= 24) return joint <= 20 ? joint + 4 : joint - 4;
  if (joint >= 33) return joint == 33 ? 34 : 33;
  return joint;
}

bool is_left(int joint) {
  return mirror_joint(joint) > joint;
}

// The vertices of one ring at a place. Of a body ring with a hole, only pairs at equal heights over and under
// the middle are taken, so that the mean stays in the ring's centre.
std::vector<int> ring_vertices(const QuadrupedMesh& mesh, const Place& place, int ring) {
  const auto& row = mesh.rings_of(place.part)[static_cast<std::size_t>(ring)];
  const bool whole = place.first_side == kAllSides;
  const int first = whole ? 0 : place.first_side;
  const int last = whole ? static_cast<int>(row.size()) - 1 : place.last_side;
  std::vector<int> vertices;
  for (int side = first; side <= last; ++side) {
    const int opposite = (kBodySides / 2 - side + kBodySides) % kBodySides;
    const bool paired = place.part != Part::body || !whole || row[static_cast<std::size_t>(opposite)] >= 0;
    const int vertex = row[static_cast<std::size_t>(side)];
    if (vertex >= 0 && paired) vertices.push_back(vertex);
  }
  return vertices;
}

void add_mean(const QuadrupedMesh& mesh, const WeightedPlace& at, bool mirrored, Eigen::MatrixXd& regressor,
              int joint) {
  const int lower = static_cast<int>(std::floor(at.place.ring));
  const double above = at.place.ring - lower;
  for (const auto& [ring, share] : {std::pair(lower, 1.0 - above), std::pair(lower + 1, above)}) {
    if (share == 0.0) continue;
    const std::vector<int> vertices = ring_vertices(mesh, at.place, ring);
    for (const int vertex : vertices) {
      const int column = mirrored ? mesh.mirror[static_cast<std::size_t>(vertex)] : vertex;
      regressor(joint, column) += at.weight * share / static_cast<double>(vertices.size());
    }
  }
}

}  // namespace

const std::array<JointName, kNumJoints>& synthetic_joints() {
  static constexpr std::array<JointName, kNumJoints> kJoints = {{
      {"root", -1},             // 0: hips
      {"spine_1", 0},           // 1: the back, from the hips to the withers
      {"spine_2", 1},           // 2
      {"spine_3", 2},           // 3
      {"spine_4", 3},           // 4
      {"spine_5", 4},           // 5
      {"spine_6", 5},           // 6: withers
      {"left_shoulder", 6},     // 7
      {"left_elbow", 7},        // 8
      {"left_carpus", 8},       // 9
      {"left_fore_foot", 9},    // 10
      {"right_shoulder", 6},    // 11
      {"right_elbow", 11},      // 12
      {"right_carpus", 12},     // 13
      {"right_fore_foot", 13},  // 14
      {"neck", 6},              // 15
      {"head", 15},             // 16
      {"left_hip", 0},          // 17
      {"left_stifle", 17},      // 18
      {"left_hock", 18},        // 19
      {"left_hind_foot", 19},   // 20
      {"right_hip", 0},         // 21
      {"right_stifle", 21},     // 22
      {"right_hock", 22},       // 23
      {"right_hind_foot", 23},  // 24
      {"tail_1", 0},            // 25
      {"tail_2", 25},           // 26
      {"tail_3", 26},           // 27
      {"tail_4", 27},           // 28
      {"tail_5", 28},           // 29
      {"tail_6", 29},           // 30
      {"tail_7", 30},           // 31
      {"jaw", 16},              // 32
      {"left_ear", 16},         // 33
      {"right_ear", 16},        // 34
  }};
  return kJoints;
}

Eigen::MatrixXd joint_regressor(const QuadrupedMesh& mesh) {
  Eigen::MatrixXd regressor =
      Eigen::MatrixXd::Zero(kNumJoints, static_cast<Eigen::Index>(mesh.vertices.size()));
  for (int joint = 0; joint < kNumJoints; ++joint) {
    const bool left = is_left(joint);
    for (const WeightedPlace& at : joint_places(left ? mirror_joint(joint) : joint)) {
      add_mean(mesh, at, left, regressor, joint);
    }
  }
  return regressor;
}

std::vector<std::vector<std::int64_t>> keypoint_groups(const QuadrupedMesh& mesh) {
  std::vector<std::vector<std::int64_t>> groups(kNumKeypoints);
  const auto add = [&](std::size_t keypoint, Part part, int ring, const std::vector<int>& sides) {
    for (const int side : sides) {
      groups[keypoint].push_back(
          mesh.rings_of(part)[static_cast<std::size_t>(ring)][static_cast<std::size_t>(side)]);
    }
  };
  // Adds to the right keypoint and its mirror image to the left one.
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

}  // namespace q3d::smal
