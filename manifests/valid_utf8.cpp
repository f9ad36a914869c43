#include "manifests/valid_utf8.h"

#include <cstddef>

namespace q3d::manifests {
namespace {

unsigned char byte_at(std::string_view text, std::size_t at) {
  return static_cast<unsigned char>(text[at]);
}

// Returns whether a character may begin with these two bytes. Others are longer than they need to be, halves
// of a UTF-16 pair (U+D800 to U+DFFF), or lie above U+10FFFF.
bool may_begin(unsigned char first, unsigned char second) {
  if (first == 0xE0) return second >= 0xA0;
  if (first == 0xED) return second <= 0x9F;
  if (first == 0xF0) return second >= 0x90;
  if (first == 0xF4) return second <= 0x8F;
  return first >= 0xC2 && first < 0xF4;
}

// Returns how many bytes the character has with which the text begins; 0 if it begins with none. The text
// must not be empty.
std::size_t size_of_first(std::string_view text) {
  const unsigned char first = byte_at(text, 0);
  if (first < 0x80) return 1;
  const std::size_t size = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (text.size() < size || !may_begin(first, byte_at(text, 1))) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte_at(text, i) & 0xC0U) != 0x80U) return 0;
  }
  return size;
}

void append_hex(std::string& text, unsigned char byte) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  text += "\\x";
  text += kDigits[byte >> 4U];
  text += kDigits[byte & 15U];
}

}  // namespace

std::string valid_utf8(std::string_view text) {
  std::string valid;
  valid.reserve(text.size());
  while (!text.empty()) {
    const std::size_t size = size_of_first(text);
    if (size == 0) {
      append_hex(valid, byte_at(text, 0));
    } else {
      valid += text.substr(0, size);
    }
    text.remove_prefix(size == 0 ? 1 : size);
  }
  return valid;
}

}  // namespace q3d::manifests
