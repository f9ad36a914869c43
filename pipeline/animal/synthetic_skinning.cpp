// Skinning weights of the synthetic quadruped.
#include <algorithm>
#include <cmath>

#include "pipeline/animal/synthetic_skeleton.h"

namespace q3d::pipeline::animal {
namespace {

double smooth_step(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Adds `share` times the weights that the joints of a part have at one of its rings. Everything before the
// first joint belongs to that joint.
void add_chain(Part part, double ring, double share, Eigen::MatrixXd& weights, Eigen::Index vertex) {
  int before = -1;
  for (int joint = 0; joint < smal::kNumJoints; ++joint) {
    const JointSpec& spec = synthetic_joints()[static_cast<std::size_t>(joint)];
    if (spec.part != part) continue;
    const double reached =
        before < 0 ? 1.0 : smooth_step((ring - spec.ring + spec.blend) / (2.0 * spec.blend));
    weights(vertex, joint) += share * reached;
    if (before >= 0) weights(vertex, before) -= share * reached;
    before = joint;
  }
}

// Says how a tube's joints pull at the body around its hole.
struct Root {
  Part part;
  int solid_ring;  // from this ring on the tube moves with its own joints only
  int passes;      // smoothing passes: how far the pull spreads
  int pad;  // sides of the body above the hole, towards the back, that move with the limb: shoulder blade
            // and haunch
};

constexpr Root kRoots[] = {{Part::right_foreleg, 2, 10, 6},
                           {Part::right_hindleg, 2, 10, 6},
                           {Part::tail, 1, 3, 0},
                           {Part::jaw, 1, 2, 0},
                           {Part::right_ear, 1, 2, 0}};

// Returns (V) the share of the tube's bones, which is 1 on the tube and fades into the body. For right and
// middle tubes only.
Eigen::VectorXd pull_of(const QuadrupedMesh& mesh, const Root& root) {
  const Hole& hole = tube_of(root.part).hole;
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(mesh.vertices.size()));
  std::vector<bool> fixed(mesh.vertices.size(), false);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const MeshVertex& at = mesh.vertices[v];
    const auto row = static_cast<Eigen::Index>(v);
    if (at.part == root.part) {
      pull[row] = 1.0;
      fixed[v] = at.ring >= root.solid_ring;
    } else if (at.part == Part::body && at.ring >= hole.first_ring && at.ring <= hole.last_ring) {
      const int above = hole.first_side - at.side;
      if (above >= 0 && above < root.pad)
        pull[row] = smooth_step(1.0 - static_cast<double>(above) / root.pad);
    }
  }
  for (int pass = 0; pass < root.passes; ++pass) {
    Eigen::VectorXd next = pull;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      if (fixed[v]) continue;
      double mean = 0.0;
      for (const int neighbour : mesh.neighbours[v]) mean += pull[neighbour];
      mean /= static_cast<double>(mesh.neighbours[v].size());
      const auto row = static_cast<Eigen::Index>(v);
      next[row] += 0.6 * (mean - pull[row]);
    }
    pull = next;
  }
  return pull;
}

// Returns the ring of the body to which a vertex is attached. The first rings of a tube still move a little
// with the body at the hole.
int body_ring(const QuadrupedMesh& mesh, std::size_t vertex) {
  const MeshVertex& at = mesh.vertices[vertex];
  return at.part == Part::body ? at.ring
                               : hole_border(tube_of(at.part).hole)[static_cast<std::size_t>(at.side)][0];
}

}  // namespace

Eigen::MatrixXd skinning_weights(const QuadrupedMesh& mesh) {
  const auto count = static_cast<Eigen::Index>(mesh.vertices.size());
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(count, smal::kNumJoints);
  Eigen::VectorXd left_over = Eigen::VectorXd::Ones(count);
  const auto add_pull = [&](Part part, Eigen::Index v, double pull) {
    const MeshVertex& at = mesh.vertices[static_cast<std::size_t>(v)];
    const double share = std::min(pull, left_over[v]);
    add_chain(part, at.part == part ? at.ring : 0, share, weights, v);
    left_over[v] -= share;
  };
  for (const Root& root : kRoots) {
    const Eigen::VectorXd pull = pull_of(mesh, root);
    const Part left = mirror_part(root.part);
    for (Eigen::Index v = 0; v < count; ++v) {
      add_pull(root.part, v, pull[v]);
      if (left != root.part) add_pull(left, v, pull[mesh.mirror[static_cast<std::size_t>(v)]]);
    }
  }
  constexpr double kLeast = 1e-3;  // smaller shares are noise that would only cost time
  for (Eigen::Index v = 0; v < count; ++v) {
    add_chain(Part::body, body_ring(mesh, static_cast<std::size_t>(v)), left_over[v], weights, v);
    weights.row(v) = (weights.row(v).array() < kLeast).select(0.0, weights.row(v)).eval();
    weights.row(v) /= weights.row(v).sum();
  }
  return weights;
}

}  // namespace q3d::pipeline::animal
