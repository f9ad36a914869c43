// Compares the spelling of names, so that a message about an unknown name can say which one was meant.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::manifests {

// Returns the number of letters to add, drop or replace that turn one word into the other (the Levenshtein
// distance).
std::size_t edit_distance(std::string_view a, std::string_view b);

// Returns true if one word is probably the other misspelt: at most a third of the letters differ.
bool is_misspelling(std::string_view a, std::string_view b);

// Returns the candidate with the least edit distance to `word`, and an empty text without candidates.
std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

// Returns "; did you mean "build"?" for the nearest candidate if `word` is probably a misspelling of it, or
// the beginning of it. Otherwise returns an empty text.
std::string suggestion(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace q3d::manifests
