#include "pipeline/evaluation/text_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace q3d::pipeline::evaluation {

TextTable::TextTable(std::vector<std::string> header, std::size_t text_columns)
    : rows_{std::move(header)}, text_columns_(text_columns) {}

void TextTable::add(std::vector<std::string> row) {
  if (row.size() != rows_.front().size()) {
    throw std::logic_error(
        fmt::format("table row: got {} cells, expected {}", row.size(), rows_.front().size()));
  }
  rows_.push_back(std::move(row));
}

std::string TextTable::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  std::string text;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c > 0) line += "  ";
      line += c < text_columns_ ? fmt::format("{:<{}}", row[c], widths[c])
                                : fmt::format("{:>{}}", row[c], widths[c]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + '\n';
  }
  return text;
}

std::string cell(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "-";
}

}  // namespace q3d::pipeline::evaluation
