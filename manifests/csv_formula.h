// Finds cells of CSV files that a spreadsheet takes for a formula.
#pragma once

#include <string_view>

namespace q3d::manifests {

// Returns whether a spreadsheet may evaluate this cell as a formula, and so run what a stranger has put into
// a name. Such cells are still written unchanged, because readers compare ids byte for byte. The writer of a
// table reports how many of them it has.
inline bool looks_like_formula(std::string_view cell) {
  return !cell.empty() && std::string_view("=+-@\t\r").find(cell.front()) != std::string_view::npos;
}

}  // namespace q3d::manifests
