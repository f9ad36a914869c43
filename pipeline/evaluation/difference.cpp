#include "pipeline/evaluation/difference.h"

#include <fmt/format.h>

#include <iterator>
#include <stdexcept>
#include <utility>

#include "pipeline/evaluation/text_table.h"

namespace q3d::pipeline::evaluation {

std::string_view to_string(Finding finding) {
  if (finding == Finding::better) return "better";
  return finding == Finding::worse ? "worse" : "no difference shown";
}

Finding finding(const filters::BootstrapInterval& difference, bool higher_is_better) {
  if (difference.low > 0.0) return higher_is_better ? Finding::better : Finding::worse;
  if (difference.high < 0.0) return higher_is_better ? Finding::worse : Finding::better;
  return Finding::no_difference_shown;
}

void require_pairs(std::size_t before, std::size_t after, std::string_view what) {
  if (before > 0 && before == after) return;
  throw std::invalid_argument(
      fmt::format("got {} {} before and {} after, expected as many of each, 1 or more", before, what, after));
}

std::string picture_of(const std::string& sample_id) {
  return sample_id.substr(0, sample_id.rfind('#'));
}

void add_difference(const ComparedMeans& row, nlohmann::ordered_json& object) {
  object["before"] = row.before;
  object["after"] = row.after;
  object["difference"] = row.difference.mean;
  object["low"] = row.difference.low;
  object["high"] = row.difference.high;
  object["finding"] = to_string(row.finding);
}

void add_bootstrap(const filters::BootstrapOptions& options, nlohmann::ordered_json& document) {
  document["resamples"] = options.resamples;
  document["confidence"] = options.confidence;
  document["seed"] = options.seed;
}

void append(std::vector<std::string> more, std::vector<std::string>& cells) {
  std::move(more.begin(), more.end(), std::back_inserter(cells));
}

std::vector<std::string> difference_titles(const filters::BootstrapOptions& options) {
  return {"before",   "after",  "difference", fmt::format("{:g} % interval", 100.0 * options.confidence),
          "change %", "finding"};
}

std::vector<std::string> difference_cells(const ComparedMeans& row) {
  const int decimals = kMetrics[index_of(row.metric)].decimals;
  const filters::BootstrapInterval& difference = row.difference;
  return {cell(row.before, decimals),
          cell(row.after, decimals),
          fmt::format("{:+.{}f}", difference.mean, decimals),
          fmt::format("{:+.{}f} .. {:+.{}f}", difference.low, decimals, difference.high, decimals),
          row.before == 0.0 ? "-" : fmt::format("{:+.1f}", 100.0 * difference.mean / row.before),
          std::string(to_string(row.finding))};
}

}  // namespace q3d::pipeline::evaluation
