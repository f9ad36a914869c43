#include "manifests/json_mask.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string_view>

namespace q3d::manifests {
namespace {

bool is_token_char(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '+' ||
         c == '.';
}

// Returns whether a bare word is a number that JSON cannot hold. Most words are short plain numbers, so the
// cheap tests come first.
bool is_no_json_number(std::string_view word) {
  if (word == "NaN" || word == "Infinity" || word == "-Infinity") return true;
  const bool is_number = word[0] == '-' || (word[0] >= '0' && word[0] <= '9');
  const bool may_overflow = word.size() > 300 || word.find_first_of("eE") != std::string_view::npos;
  return is_number && may_overflow && std::isinf(std::strtod(std::string(word).c_str(), nullptr));
}

}  // namespace

std::size_t JsonMask::apply(std::string& text, std::size_t from, bool is_end) {
  std::size_t i = from;
  while (i < text.size()) {
    if (in_string_ && text[i] == '\\') {
      if (i + 1 == text.size() && !is_end) return i;
      i += 2;
    } else if (text[i] == '"') {
      in_string_ = !in_string_;
      ++i;
    } else if (!in_string_ && is_token_char(text[i])) {
      std::size_t end = i;
      while (end < text.size() && is_token_char(text[end])) ++end;
      if (end == text.size() && !is_end) return i;
      const std::string_view word = std::string_view(text).substr(i, end - i);
      if (word.size() > 2 && is_no_json_number(word)) {
        std::fill(text.begin() + static_cast<std::ptrdiff_t>(i),
                  text.begin() + static_cast<std::ptrdiff_t>(end), '~');
        text[i] = text[end - 1] = '"';
      }
      i = end;
    } else {
      ++i;
    }
  }
  return text.size();
}

}  // namespace q3d::manifests
