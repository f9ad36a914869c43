#pragma once

#include <algorithm>
#include <string_view>

namespace q3d::manifests {

// Cuts the first field, which reaches to the next `end` or to the end of the text, off `text`, and returns it
// without its `end`.
inline std::string_view next_field(std::string_view& text, char end) {
  const std::size_t at = std::min(text.find(end), text.size());
  const std::string_view field = text.substr(0, at);
  text.remove_prefix(std::min(at + 1, text.size()));
  return field;
}

}  // namespace q3d::manifests
