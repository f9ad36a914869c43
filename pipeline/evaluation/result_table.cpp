#include "pipeline/evaluation/result_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Table;

template <typename T>
std::span<const T> numbers_of(const Table& table, const char* name, std::size_t per_row) {
  const std::span<const T> numbers = table.column<T>(name);
  if (numbers.size() == static_cast<std::size_t>(table.rows) * per_row) return numbers;
  throw std::runtime_error(fmt::format("column {}: got {} numbers, expected {} rows of {}", name,
                                       numbers.size(), table.rows, per_row));
}

const std::vector<std::string>& texts_of(const Table& table, const char* name) {
  const auto found = table.text.find(name);
  if (found != table.text.end()) return found->second;
  throw std::runtime_error(fmt::format("there is no column {}", name));
}

void require_same_samples(const std::vector<std::string>& ids, std::span<const SampleResult> results) {
  const bool are_same =
      std::equal(ids.begin(), ids.end(), results.begin(), results.end(),
                 [](const std::string& id, const SampleResult& result) { return id == result.id; });
  if (!are_same) throw std::runtime_error("the rows are those of other samples");
}

}  // namespace

Table to_table(std::span<const SampleResult> results, std::size_t settings) {
  Table table;
  table.rows = static_cast<std::int64_t>(results.size());
  std::vector<std::uint8_t> by_mask;
  std::vector<std::uint8_t> is_measured(results.size() * settings * kMetricCount);
  std::vector<double> values(is_measured.size());
  std::vector<float> betas(results.size() * settings * smal::kNumBetas);
  for (std::size_t i = 0; i < results.size(); ++i) {
    const SampleResult& result = results[i];
    table.text["id"].push_back(result.id);
    table.text["failure"].emplace_back(manifests::to_string(result.failure));
    table.text["detail"].push_back(result.detail);
    by_mask.push_back(result.normalised_by_mask ? 1 : 0);
    for (std::size_t s = 0; s < result.values.size(); ++s) {
      const std::size_t row = i * settings + s;
      for (std::size_t m = 0; m < kMetricCount; ++m) {
        is_measured[row * kMetricCount + m] = result.values[s][m] ? 1 : 0;
        values[row * kMetricCount + m] = result.values[s][m].value_or(0.0);
      }
      std::copy(result.betas[s].begin(), result.betas[s].end(),
                betas.begin() + static_cast<std::ptrdiff_t>(row * smal::kNumBetas));
    }
  }
  const auto rows = static_cast<std::int64_t>(settings);
  const auto metrics = static_cast<std::int64_t>(kMetricCount);
  table.add<std::uint8_t>("normalised_by_mask", {}, by_mask);
  table.add<std::uint8_t>("is_measured", {rows, metrics}, is_measured);
  table.add<double>("values", {rows, metrics}, values);
  table.add<float>("betas", {rows, smal::kNumBetas}, betas);
  return table;
}

void set_measured(const Table& table, std::size_t settings, std::span<SampleResult> results) {
  require_same_samples(texts_of(table, "id"), results);
  const std::vector<std::string>& failures = texts_of(table, "failure");
  const std::vector<std::string>& details = texts_of(table, "detail");
  const auto by_mask = numbers_of<std::uint8_t>(table, "normalised_by_mask", 1);
  const auto is_measured = numbers_of<std::uint8_t>(table, "is_measured", settings * kMetricCount);
  const auto values = numbers_of<double>(table, "values", settings * kMetricCount);
  const auto betas = numbers_of<float>(table, "betas", settings * smal::kNumBetas);
  for (std::size_t i = 0; i < results.size(); ++i) {
    SampleResult& result = results[i];
    result.failure = manifests::reason_from_string(failures[i]);
    result.detail = details[i];
    result.normalised_by_mask = by_mask[i] != 0;
    if (result.failure != manifests::Reason::none) continue;
    result.values.resize(settings);
    result.betas.resize(settings);
    for (std::size_t s = 0; s < settings; ++s) {
      const std::size_t row = i * settings + s;
      for (std::size_t m = 0; m < kMetricCount; ++m) {
        if (is_measured[row * kMetricCount + m] != 0) result.values[s][m] = values[row * kMetricCount + m];
      }
      std::copy_n(betas.begin() + static_cast<std::ptrdiff_t>(row * smal::kNumBetas), smal::kNumBetas,
                  result.betas[s].begin());
    }
  }
}

}  // namespace q3d::pipeline::evaluation
