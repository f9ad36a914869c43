#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "loaders/formats/label_table.h"

namespace q3d::loaders::formats {
namespace {

// A spreadsheet may have rounded coordinates to whole pixels.
constexpr double kRoundingPx = 0.5;

using ColumnName = std::tuple<std::string, std::string, std::string>;

ColumnName name_of(const LabelColumn& column) {
  return {column.individual, column.bodypart, column.coordinate};
}

bool is_equal(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) || std::abs(a - b) <= kRoundingPx;
}

// Says how many rows of `table` are missing in `other`, and names the first.
std::string lacking(const LabelTable& table, const std::map<std::string, std::size_t>& other) {
  std::size_t count = 0;
  std::string first;
  for (const std::string& row : table.rows) {
    if (other.contains(row)) continue;
    if (count++ == 0) first = row;
  }
  return count == 0 ? "" : fmt::format("{} row{}, first {}", count, count == 1 ? "" : "s", first);
}

std::map<std::string, std::size_t> places(const LabelTable& table) {
  std::map<std::string, std::size_t> found;
  for (std::size_t i = 0; i < table.rows.size(); ++i) found.emplace(table.rows[i], i);
  return found;
}

}  // namespace

std::string difference_of(const LabelTable& table, const LabelTable& other) {
  const auto rows = places(other);
  if (const std::string rows_missing = lacking(table, rows); !rows_missing.empty()) {
    return fmt::format("which lacks {}", rows_missing);
  }
  if (const std::string rows_more = lacking(other, places(table)); !rows_more.empty()) {
    return fmt::format("which has {} more", rows_more);
  }
  std::map<ColumnName, std::size_t> columns;
  for (std::size_t i = 0; i < other.columns.size(); ++i) columns.emplace(name_of(other.columns[i]), i);
  std::size_t count = 0;
  std::string first;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      const auto column = columns.find(name_of(table.columns[i]));
      const double here = table.at(row, i);
      const double there =
          column == columns.end() ? std::nan("") : other.at(rows.at(table.rows[row]), column->second);
      if (is_equal(here, there) || count++ > 0) continue;
      first = fmt::format("first {} of {} in {}: {} and {}", table.columns[i].coordinate,
                          table.columns[i].bodypart, table.rows[row], here, there);
    }
  }
  return count == 0
             ? ""
             : fmt::format("which differs from it in {} number{}, {}", count, count == 1 ? "" : "s", first);
}

}  // namespace q3d::loaders::formats
