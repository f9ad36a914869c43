// A table for a terminal. Columns are as wide as their widest cell, and numbers are aligned to the right.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace q3d::pipeline::evaluation {

class TextTable {
 public:
  // The first `text_columns` columns are aligned to the left.
  TextTable(std::vector<std::string> header, std::size_t text_columns);
  void add(
      std::vector<std::string> row);  // throws std::logic_error on another number of cells than the header
  bool empty() const { return rows_.size() == 1; }
  std::string text() const;  // header and rows, a line each, no trailing spaces

 private:
  std::vector<std::vector<std::string>> rows_;
  std::size_t text_columns_;
};

// Returns "-" for no value.
std::string cell(const std::optional<double>& value, int decimals);

}  // namespace q3d::pipeline::evaluation
