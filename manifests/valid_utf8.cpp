#include "manifests/valid_utf8.h"

#include <fmt/format.h>
#include <unicode/utf8.h>

#include <cstdint>

namespace q3d::manifests {
namespace {

// Reads the character that begins at `at`, and moves `at` behind it. Returns whether its bytes are UTF-8.
bool read_character(std::string_view text, std::int32_t& at) {
  UChar32 character = 0;
  U8_NEXT(text.data(), at, static_cast<std::int32_t>(text.size()), character);
  return character >= 0;
}

}  // namespace

bool is_utf8(std::string_view text) {
  for (std::int32_t at = 0; at < static_cast<std::int32_t>(text.size());) {
    if (!read_character(text, at)) return false;
  }
  return true;
}

std::string valid_utf8(std::string_view text) {
  std::string valid;
  valid.reserve(text.size());
  for (std::int32_t at = 0; at < static_cast<std::int32_t>(text.size());) {
    const std::int32_t first = at;
    const bool is_valid = read_character(text, at);
    const std::string_view bytes =
        text.substr(static_cast<std::size_t>(first), static_cast<std::size_t>(at - first));
    if (is_valid) {
      valid += bytes;
    } else {
      for (const char byte : bytes) valid += fmt::format("\\x{:02x}", static_cast<unsigned char>(byte));
    }
  }
  return valid;
}

}  // namespace q3d::manifests
