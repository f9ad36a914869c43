#include "loaders/formats/bounded_text.h"

#include "manifests/digest.h"

namespace q3d::loaders::formats {

std::string bounded_text(std::string text) {
  if (text.size() <= kMaxTextBytes) return text;
  constexpr std::size_t kKept = 200;
  constexpr std::size_t kDigits = 12;
  const std::string digest = manifests::sha256(text).substr(0, kDigits);
  std::size_t kept = kKept;
  // A UTF-8 character is never cut, because ids are written as JSON.
  while (kept > 0 && (static_cast<unsigned char>(text[kept]) & 0xC0U) == 0x80U) --kept;
  text.resize(kept);
  return text + "~" + digest;
}

}  // namespace q3d::loaders::formats
