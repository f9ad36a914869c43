#include "manifests/file_name.h"

#include <algorithm>

#include "manifests/next_field.h"

namespace q3d::manifests {

bool is_file_name(std::string_view text) {
  const bool is_plain = std::none_of(text.begin(), text.end(), [](unsigned char c) {
    return c < 0x20 || c == 0x7f || c == '/' || c == '\\' || c == ':';
  });
  return is_plain && !text.empty() && text != "." && text != "..";
}

bool leads_below(std::string_view path) {
  if (path.empty() || path.ends_with('/')) return false;
  while (!path.empty()) {
    if (!is_file_name(next_field(path, '/'))) return false;
  }
  return true;
}

}  // namespace q3d::manifests
