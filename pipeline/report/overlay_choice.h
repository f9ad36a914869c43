// Chooses the candidates of a dataset that are shown.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "filters/fidelity.h"
#include "pipeline/dataset/verdicts.h"

namespace q3d::pipeline::report {

enum class Order : std::uint8_t {
  spread,          // evenly over the dataset
  worst,           // largest final L_proj first
  best,            // smallest final L_proj first
  near_threshold,  // initial L_proj nearest to tau_low or tau_high
};

struct Choice {
  std::vector<std::string> ids{};  // ids or parts of ids; empty takes all candidates
  // Filters; an empty one lets all pass.
  std::vector<std::string> species{};
  std::vector<std::string> families{};
  std::vector<std::string> datasets{};
  std::vector<std::string> verdicts{};  // names of verdicts, or of reasons
  Order order = Order::spread;
  std::size_t count = 12;  // at most; with ids and Order::spread, of each part of an id
};

using ThresholdsByDataset = std::map<std::string, filters::Thresholds>;

// The chosen rows in the order that was asked for. With ids alone (Order::spread): in the order of the ids. A
// row without the number that an order sorts by is left out. Throws ConfigError for a verdict, reason or
// family that does not exist, and std::runtime_error for an id that no candidate that passes the filters has
// or holds.
std::vector<dataset::VerdictRow> choose(const std::vector<dataset::VerdictRow>& rows,
                                        const ThresholdsByDataset& thresholds, const Choice& choice);

// |initial L_proj - threshold|, for the nearer of its dataset's two thresholds. NaN where it was not judged.
double distance_to_threshold(const dataset::VerdictRow& row, const ThresholdsByDataset& thresholds);

}  // namespace q3d::pipeline::report
