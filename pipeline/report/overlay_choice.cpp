#include "pipeline/report/overlay_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include "manifests/enumerators.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::report {
namespace {

using dataset::VerdictRow;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool is_among(const std::string& value, const std::vector<std::string>& wanted) {
  return wanted.empty() || std::find(wanted.begin(), wanted.end(), value) != wanted.end();
}

bool is_name(const std::string& name, std::span<const std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void check_names(const Choice& choice) {
  for (const std::string& name : choice.verdicts) {
    if (is_name(name, manifests::verdict_names()) || is_name(name, manifests::reason_names())) continue;
    throw run::ConfigError(
        fmt::format("--verdict: got {}, expected one of {}, or a reason such as gain_too_small", name,
                    fmt::join(manifests::verdict_names(), ", ")));
  }
  for (const std::string& name : choice.families) {
    try {
      manifests::family_from_string(name);
    } catch (const std::invalid_argument& error) {
      throw run::ConfigError(fmt::format("--family: {}", error.what()));
    }
  }
}

bool passes(const VerdictRow& row, const Choice& choice) {
  const bool verdict_fits =
      choice.verdicts.empty() ||
      is_among(std::string(manifests::to_string(row.judgement.verdict)), choice.verdicts) ||
      is_among(std::string(manifests::to_string(row.judgement.reason)), choice.verdicts);
  return verdict_fits && is_among(row.species, choice.species) && is_among(row.dataset, choice.datasets) &&
         is_among(std::string(manifests::to_string(row.family)), choice.families);
}

// Returns the candidate with this id, or else every candidate whose id contains the text.
std::vector<VerdictRow> with_id(const std::vector<VerdictRow>& rows, const std::string& id) {
  std::vector<VerdictRow> found;
  for (const VerdictRow& row : rows) {
    if (row.id == id) return {row};
    if (row.id.find(id) != std::string::npos) found.push_back(row);
  }
  if (found.empty()) {
    throw std::runtime_error(fmt::format(
        "no candidate that passes the filters has an id that is or contains {}; verdicts.csv lists all", id));
  }
  return found;
}

std::vector<VerdictRow> spread(const std::vector<VerdictRow>& rows, std::size_t count) {
  std::vector<VerdictRow> chosen;
  const std::size_t wanted = std::min(count, rows.size());
  for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(rows[i * rows.size() / wanted]);
  return chosen;
}

// Returns at most `most` rows for each part of an id.
std::vector<VerdictRow> named(const std::vector<VerdictRow>& rows, const std::vector<std::string>& ids,
                              std::size_t most) {
  std::vector<VerdictRow> found;
  for (const std::string& id : ids) {
    for (VerdictRow& row : spread(with_id(rows, id), most)) {
      const bool is_new = std::none_of(found.begin(), found.end(),
                                       [&](const VerdictRow& other) { return other.id == row.id; });
      if (is_new) found.push_back(std::move(row));
    }
  }
  return found;
}

// Sorts the rows by the number, ascending, and drops rows without one.
void sort_by(std::vector<VerdictRow>& rows, const std::function<double(const VerdictRow&)>& number) {
  std::erase_if(rows, [&](const VerdictRow& row) { return !std::isfinite(number(row)); });
  std::stable_sort(rows.begin(), rows.end(),
                   [&](const VerdictRow& a, const VerdictRow& b) { return number(a) < number(b); });
}

}  // namespace

double distance_to_threshold(const VerdictRow& row, const ThresholdsByDataset& thresholds) {
  const auto found = thresholds.find(row.dataset);
  if (found == thresholds.end() || !row.is_judged()) return kNaN;
  return std::min(std::abs(row.judgement.initial_error - found->second.tau_low),
                  std::abs(row.judgement.initial_error - found->second.tau_high));
}

std::vector<VerdictRow> choose(const std::vector<VerdictRow>& rows, const ThresholdsByDataset& thresholds,
                               const Choice& choice) {
  check_names(choice);
  const bool is_spread = choice.order == Order::spread;
  std::vector<VerdictRow> passing = rows;
  std::erase_if(passing, [&](const VerdictRow& row) { return !passes(row, choice); });
  if (is_spread && choice.ids.empty()) return spread(passing, choice.count);
  const std::size_t most = is_spread ? choice.count : rows.size();
  std::vector<VerdictRow> chosen = choice.ids.empty() ? std::move(passing) : named(passing, choice.ids, most);
  switch (choice.order) {
    case Order::spread:
      return chosen;
    case Order::worst:
      sort_by(chosen, [](const VerdictRow& row) { return -row.judgement.final_error; });
      break;
    case Order::best:
      sort_by(chosen, [](const VerdictRow& row) { return row.judgement.final_error; });
      break;
    case Order::near_threshold:
      sort_by(chosen, [&](const VerdictRow& row) { return distance_to_threshold(row, thresholds); });
      break;
  }
  if (chosen.size() > choice.count) chosen.resize(choice.count);
  return chosen;
}

}  // namespace q3d::pipeline::report
