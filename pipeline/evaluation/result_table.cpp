#include "pipeline/evaluation/result_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Table;

// Ids and details may hold any character, also NUL, which a column of text cannot.
std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

const std::vector<std::vector<std::byte>>& blobs_of(const Table& table, const char* name) {
  const auto found = table.blobs.find(name);
  if (found != table.blobs.end()) return found->second;
  throw std::runtime_error(fmt::format("blob column {} is missing", name));
}

void require_same_samples(const Table& table, std::span<const SampleResult> results) {
  const auto& ids = blobs_of(table, "id");
  const bool are_same = std::equal(
      ids.begin(), ids.end(), results.begin(), results.end(),
      [](const std::vector<std::byte>& id, const SampleResult& result) { return text_of(id) == result.id; });
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
    table.blobs["id"].push_back(bytes_of(result.id));
    table.text["failure"].emplace_back(manifests::to_string(result.failure));
    table.blobs["detail"].push_back(bytes_of(result.detail));
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
  require_same_samples(table, results);
  const std::vector<std::string>& failures = table.texts("failure");
  const auto& details = blobs_of(table, "detail");
  const auto by_mask = table.column<std::uint8_t>("normalised_by_mask", 1);
  const auto is_measured = table.column<std::uint8_t>("is_measured", settings * kMetricCount);
  const auto values = table.column<double>("values", settings * kMetricCount);
  const auto betas = table.column<float>("betas", settings * smal::kNumBetas);
  for (std::size_t i = 0; i < results.size(); ++i) {
    SampleResult& result = results[i];
    result.failure = manifests::reason_from_string(failures[i]);
    result.detail = text_of(details[i]);
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
