// Shows how the labels' shapes are spread: principal components, and whether the families form groups.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

// The two directions of largest variance of the labels' 41 betas, and the share of the variance that each
// explains. A direction's sign is such that its largest component is positive, so that equal input gives the
// same picture on every machine.
struct PrincipalComponents {
  std::array<double, 2> explained{};
  std::vector<std::array<double, 2>> scores;  // scores of every point, in order
};
// Throws std::invalid_argument for fewer than 3 points.
PrincipalComponents principal_components(const std::vector<smal::Betas>& points);

// {labels, shown, explained: [2], x: [...], y, family: [names], species: [...], id: [...], ari: {value,
// clusters, seed, labels} of k-means on all betas against the families (of the labels whose family is
// known)}. At most `most` points are shown, evenly spread; all other numbers cover all labels. The result is
// null with fewer than 3 labels that have a shape.
nlohmann::ordered_json shape_space(const Facts& facts, std::size_t most = 2500);

}  // namespace q3d::pipeline::statistics
