// Words in messages: how near two are, and their plurals.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::run {

// Edits (letters added, dropped or replaced) that turn one word into the other: the Levenshtein distance.
std::size_t edit_distance(std::string_view a, std::string_view b);
// True if the words are so near that one is probably the other misspelt: a third of the letters differ at
// most.
bool is_misspelling(std::string_view a, std::string_view b);
// The candidate with the least edit distance to `word`; empty when there is none.
std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

// "; did you mean "build"?" for the nearest candidate if `word` is probably a misspelling of it, or the
// beginning of it. Otherwise nothing.
std::string suggestion(std::string_view word, const std::vector<std::string>& candidates);

// "1 shard", "2 shards". The plural is the singular with an "s" unless it is given.
std::string counted(std::int64_t count, std::string_view singular, std::string_view plural = {});

}  // namespace q3d::pipeline::run
