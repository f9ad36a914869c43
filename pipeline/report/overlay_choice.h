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
  // The following are filters; an empty one lets all candidates pass.
  std::vector<std::string> species{};
  std::vector<std::string> families{};
  std::vector<std::string> datasets{};
  std::vector<std::string> verdicts{};  // names of verdicts, or of reasons
  Order order = Order::spread;
  std::size_t count = 12;  // largest number of rows; with ids and Order::spread, for each part of an id
};

using ThresholdsByDataset = std::map<std::string, filters::Thresholds>;

// Returns the chosen rows in the requested order. With ids and Order::spread, it is the order of the ids. A
// row without the number that an order sorts by is left out. Throws ConfigError for a verdict, reason or
// family that does not exist, and std::runtime_error for a part of an id that occurs in no candidate that
// passes the filters.
std::vector<dataset::VerdictRow> choose(const std::vector<dataset::VerdictRow>& rows,
                                        const ThresholdsByDataset& thresholds, const Choice& choice);

// Returns |initial L_proj - threshold| for the nearer of its dataset's two thresholds, or NaN if it was not
// judged.
double distance_to_threshold(const dataset::VerdictRow& row, const ThresholdsByDataset& thresholds);

}  // namespace q3d::pipeline::report
