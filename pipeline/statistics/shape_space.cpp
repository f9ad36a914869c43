#include "pipeline/statistics/shape_space.h"

#include <Eigen/Dense>

#include <algorithm>
#include <set>
#include <stdexcept>

#include "filters/clustering.h"
#include "pipeline/statistics/numbers.h"

namespace q3d::pipeline::statistics {
namespace {

using nlohmann::ordered_json;
using smal::Betas;

// The paper groups by the five families.
constexpr int kClusters = 5;
constexpr std::uint64_t kSeed = 0;

// Returns null if the labels are too few or belong to one family, because the index is then meaningless.
ordered_json family_agreement(const std::vector<const CandidateFacts*>& labels) {
  std::vector<float> points;
  std::vector<int> families;
  for (const CandidateFacts* label : labels) {
    if (label->row.family == manifests::Family::none) continue;
    points.insert(points.end(), label->betas->begin(), label->betas->end());
    families.push_back(static_cast<int>(label->row.family));
  }
  const bool is_one_family = std::set(families.begin(), families.end()).size() < 2;
  if (families.size() < static_cast<std::size_t>(kClusters) || is_one_family) return nullptr;
  filters::KMeansOptions options;
  options.clusters = kClusters;
  options.seed = kSeed;
  const std::vector<int> clusters = filters::k_means(points, manifests::kNumBetas, options);
  return {{"value", rounded(filters::adjusted_rand_index(clusters, families), 4)},
          {"clusters", kClusters},
          {"seed", kSeed},
          {"labels", families.size()}};
}

}  // namespace

PrincipalComponents principal_components(const std::vector<Betas>& points) {
  if (points.size() < 3) throw std::invalid_argument("principal_components: fewer than 3 points");
  constexpr Eigen::Index kDimensions = manifests::kNumBetas;
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(points.size()), kDimensions);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (Eigen::Index d = 0; d < kDimensions; ++d) {
      matrix(static_cast<Eigen::Index>(i), d) = points[i][static_cast<std::size_t>(d)];
    }
  }
  matrix.rowwise() -= matrix.colwise().mean().eval();
  const Eigen::MatrixXd covariance = matrix.transpose() * matrix / static_cast<double>(points.size() - 1);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const double total = covariance.trace();
  PrincipalComponents result;
  result.scores.resize(points.size());
  for (std::size_t component = 0; component < 2; ++component) {
    const Eigen::Index column = kDimensions - 1 - static_cast<Eigen::Index>(component);  // values ascend
    Eigen::VectorXd direction = solver.eigenvectors().col(column);
    Eigen::Index largest = 0;
    direction.cwiseAbs().maxCoeff(&largest);
    if (direction(largest) < 0) direction = -direction;
    result.explained[component] = total > 0 ? std::max(0.0, solver.eigenvalues()(column)) / total : 0.0;
    const Eigen::VectorXd scores = matrix * direction;
    for (std::size_t i = 0; i < points.size(); ++i) {
      result.scores[i][component] = scores(static_cast<Eigen::Index>(i));
    }
  }
  return result;
}

ordered_json shape_space(const Facts& facts, std::size_t most) {
  std::vector<const CandidateFacts*> labels;
  std::vector<Betas> points;
  for (const CandidateFacts& candidate : facts.candidates) {
    if (!candidate.betas) continue;
    labels.push_back(&candidate);
    points.push_back(*candidate.betas);
  }
  if (labels.size() < 3) return nullptr;
  const PrincipalComponents components = principal_components(points);
  ordered_json x = ordered_json::array(), y = x, family = x, species = x, id = x;
  for (const std::size_t i : spread_positions(labels.size(), most)) {
    x.push_back(rounded(components.scores[i][0], 4));
    y.push_back(rounded(components.scores[i][1], 4));
    family.push_back(manifests::to_string(labels[i]->row.family));
    species.push_back(labels[i]->row.species);
    id.push_back(labels[i]->row.id);
  }
  const std::size_t shown = x.size();
  return {{"labels", labels.size()},
          {"shown", shown},
          {"explained", {rounded(components.explained[0], 4), rounded(components.explained[1], 4)}},
          {"x", std::move(x)},
          {"y", std::move(y)},
          {"family", std::move(family)},
          {"species", std::move(species)},
          {"id", std::move(id)},
          {"ari", family_agreement(labels)}};
}

}  // namespace q3d::pipeline::statistics
