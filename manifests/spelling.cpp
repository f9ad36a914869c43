#include "manifests/spelling.h"

#include <algorithm>
#include <numeric>

namespace q3d::manifests {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

bool is_misspelling(std::string_view a, std::string_view b) {
  return 3 * edit_distance(a, b) <= std::max(a.size(), b.size());
}

std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates) {
  const auto nearest = std::min_element(
      candidates.begin(), candidates.end(),
      [&](const auto& a, const auto& b) { return edit_distance(word, a) < edit_distance(word, b); });
  return nearest == candidates.end() ? std::string() : *nearest;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
  constexpr std::size_t kLeastBeginning = 3;
  std::string meant = nearest_word(word, candidates);
  // Two exchanged letters are two edits, and commands are short: half of the letters may differ.
  const bool is_near = 2 * edit_distance(word, meant) <= std::max(word.size(), meant.size());
  if (!is_near || meant.empty()) {
    const auto longer = std::find_if(candidates.begin(), candidates.end(), [&](const std::string& candidate) {
      return word.size() >= kLeastBeginning && std::string_view(candidate).substr(0, word.size()) == word;
    });
    if (longer == candidates.end()) return {};
    meant = *longer;
  }
  return "; did you mean \"" + meant + "\"?";
}

}  // namespace q3d::manifests
