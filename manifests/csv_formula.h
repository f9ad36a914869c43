// Cells of CSV files that a spreadsheet takes for a formula.
#pragma once

#include <string_view>

namespace q3d::manifests {

// Whether a spreadsheet that opens a CSV file may compute this text, and so run what a stranger has put into
// a name. Cells are written as they are, because readers compare ids byte for byte; who writes a table says
// how many such cells it has.
inline bool looks_like_formula(std::string_view cell) {
  return !cell.empty() && std::string_view("=+-@\t\r").find(cell.front()) != std::string_view::npos;
}

}  // namespace q3d::manifests
