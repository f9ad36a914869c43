// Skinning weights of the synthetic quadruped.
#include <algorithm>
#include <cmath>

#include "smal/synthetic_skeleton.h"

namespace q3d::smal {
namespace {

// A bone takes over from the one before it around `ring`, over `half_width` rings either way.
struct Takeover {
  int joint;
  double ring;
  double half_width;
};

const std::vector<Takeover>& chain_of(Part part) {
  static const std::vector<Takeover> body = {{0, -9, 1}, {1, 8, 2.5}, {2, 12, 3},  {3, 16, 3},   {4, 20, 3},
                                             {5, 25, 4}, {6, 30, 4},  {15, 34, 4}, {16, 42, 3.5}};
  static const std::vector<Takeover> right_fore = {{11, -9, 1}, {12, 3, 2.2}, {13, 9, 2}, {14, 14, 1.6}};
  static const std::vector<Takeover> left_fore = {{7, -9, 1}, {8, 3, 2.2}, {9, 9, 2}, {10, 14, 1.6}};
  static const std::vector<Takeover> right_hind = {{21, -9, 1}, {22, 4, 2.4}, {23, 10, 1.8}, {24, 14, 1.4}};
  static const std::vector<Takeover> left_hind = {{17, -9, 1}, {18, 4, 2.4}, {19, 10, 1.8}, {20, 14, 1.4}};
  constexpr double kTail = 18.0 / 7.0;
  static const std::vector<Takeover> tail = {{25, -9, 1},          {26, kTail, 1.4},     {27, 2 * kTail, 1.4},
                                             {28, 3 * kTail, 1.4}, {29, 4 * kTail, 1.4}, {30, 5 * kTail, 1.4},
                                             {31, 6 * kTail, 1.4}};
  static const std::vector<Takeover> jaw = {{32, -9, 1}}, right_ear = {{34, -9, 1}}, left_ear = {{33, -9, 1}};
  switch (part) {
    case Part::body:
      return body;
    case Part::right_foreleg:
      return right_fore;
    case Part::left_foreleg:
      return left_fore;
    case Part::right_hindleg:
      return right_hind;
    case Part::left_hindleg:
      return left_hind;
    case Part::tail:
      return tail;
    case Part::jaw:
      return jaw;
    case Part::right_ear:
      return right_ear;
    default:
      return left_ear;
  }
}

double smooth_step(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Adds `share` of the weights of a chain at a ring.
void add_chain(const std::vector<Takeover>& chain, double ring, double share,
               Eigen::Ref<Eigen::RowVectorXd> weights) {
  const auto reached = [ring](const Takeover& bone) {
    return smooth_step((ring - bone.ring + bone.half_width) / (2.0 * bone.half_width));
  };
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const double next = i + 1 < chain.size() ? reached(chain[i + 1]) : 0.0;
    weights[chain[i].joint] += share * (reached(chain[i]) - next);
  }
}

// How a tube's bones pull at the body around its hole.
struct Root {
  Tube tube;
  int solid_ring;  // from here on the tube moves with its own bones alone
  int top_side;    // the pull over the hole fades out here, towards the back; the hole's own first side for
                   // none
  int passes;      // of smoothing: how far the pull spreads
};

std::vector<Root> roots() {
  std::vector<Root> all;
  for (const Tube& tube : kTubes) {
    switch (tube.part) {
      case Part::right_foreleg:
        all.push_back({tube, 2, 3, 10});
        break;
      case Part::right_hindleg:
        all.push_back({tube, 2, 2, 10});
        break;
      case Part::tail:
        all.push_back({tube, 1, tube.hole.first_side, 3});
        break;
      case Part::jaw:
        all.push_back({tube, 1, tube.hole.first_side, 2});
        break;
      default:
        all.push_back({tube, 1, tube.hole.first_side, 2});
        break;
    }
  }
  return all;
}

// (V): the share of the tube's bones, 1 on the tube, fading into the body; right and middle tubes only.
Eigen::VectorXd pull_of(const QuadrupedMesh& mesh, const Root& root) {
  const Hole& hole = root.tube.hole;
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(mesh.vertices.size()));
  std::vector<bool> fixed(mesh.vertices.size(), false);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const MeshVertex& at = mesh.vertices[v];
    const auto row = static_cast<Eigen::Index>(v);
    if (at.part == root.tube.part) {
      pull[row] = 1.0;
      fixed[v] = at.ring >= root.solid_ring;
    } else if (at.part == Part::body && at.ring >= hole.first_ring && at.ring <= hole.last_ring &&
               at.side > root.top_side && at.side <= hole.first_side) {
      pull[row] =
          smooth_step(static_cast<double>(at.side - root.top_side) / (hole.first_side - root.top_side));
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

}  // namespace

Eigen::MatrixXd skinning_weights(const QuadrupedMesh& mesh) {
  const auto count = static_cast<Eigen::Index>(mesh.vertices.size());
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(count, kNumJoints);
  Eigen::VectorXd left_over = Eigen::VectorXd::Ones(count);
  const auto add_pull = [&](Eigen::Index v, Part part, double pull) {
    const MeshVertex& at = mesh.vertices[static_cast<std::size_t>(v)];
    const double share = std::min(pull, left_over[v]);
    Eigen::RowVectorXd row = weights.row(v);
    add_chain(chain_of(part), at.part == part ? at.ring : -1, share, row);
    weights.row(v) = row;
    left_over[v] -= share;
  };
  for (const Root& root : roots()) {
    const Eigen::VectorXd pull = pull_of(mesh, root);
    for (Eigen::Index v = 0; v < count; ++v) add_pull(v, root.tube.part, pull[v]);
    const Part left = mirror_part(root.tube.part);
    if (left == root.tube.part) continue;
    for (Eigen::Index v = 0; v < count; ++v)
      add_pull(v, left, pull[mesh.mirror[static_cast<std::size_t>(v)]]);
  }
  constexpr double kLeast = 1e-3;  // smaller shares are noise that would only cost time
  for (Eigen::Index v = 0; v < count; ++v) {
    const MeshVertex& at = mesh.vertices[static_cast<std::size_t>(v)];
    Eigen::RowVectorXd row = weights.row(v);
    // Near a hole a tube's first rings hang on the body's bones where the hole is.
    double ring = at.ring;
    if (at.part != Part::body) {
      const auto tube = std::find_if(kTubes.begin(), kTubes.end(), [&](const Tube& t) {
        return t.part == at.part || mirror_part(t.part) == at.part;
      });
      ring = hole_border(tube->hole)[static_cast<std::size_t>(at.ring < tube->rings ? at.side : 0)][0];
    }
    add_chain(chain_of(Part::body), ring, left_over[v], row);
    row = (row.array() < kLeast).select(0.0, row);
    weights.row(v) = row / row.sum();
  }
  return weights;
}

}  // namespace q3d::smal
