#include "loaders/formats/folded_name.h"

#include <unicode/unorm2.h>
#include <unicode/ustring.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <vector>

namespace q3d::loaders::formats {
namespace {

bool is_ascii(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x80; });
}

// Returns the text in the form NFKC without letter case; nothing if it is not valid UTF-8.
std::optional<std::string> case_folded(std::string_view text) {
  UErrorCode error = U_ZERO_ERROR;
  const UNormalizer2* normalizer = unorm2_getNFKCCasefoldInstance(&error);
  std::vector<UChar> wide(text.size() + 1);  // UTF-16 never has more units than UTF-8 has bytes
  int32_t wide_size = 0;
  u_strFromUTF8(wide.data(), static_cast<int32_t>(wide.size()), &wide_size, text.data(),
                static_cast<int32_t>(text.size()), &error);
  if (U_FAILURE(error)) return std::nullopt;
  std::vector<UChar> folded(4 * wide.size());
  int32_t folded_size = unorm2_normalize(normalizer, wide.data(), wide_size, folded.data(),
                                         static_cast<int32_t>(folded.size()), &error);
  if (error == U_BUFFER_OVERFLOW_ERROR) {
    error = U_ZERO_ERROR;
    folded.resize(static_cast<std::size_t>(folded_size) + 1);
    folded_size = unorm2_normalize(normalizer, wide.data(), wide_size, folded.data(),
                                   static_cast<int32_t>(folded.size()), &error);
  }
  std::string result(3 * static_cast<std::size_t>(std::max(folded_size, 0)), '\0');
  int32_t size = 0;
  u_strToUTF8(result.data(), static_cast<int32_t>(result.size()), &size, folded.data(), folded_size, &error);
  if (U_FAILURE(error)) return std::nullopt;
  result.resize(static_cast<std::size_t>(size));
  return result;
}

}  // namespace

std::string folded_name(std::string_view name) {
  std::string text(name);
  if (!is_ascii(name)) text = case_folded(name).value_or(text);
  for (char& c : text) c = c == '+' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const std::string_view ending : {".jpeg", ".jpe"}) {
    if (text.ends_with(ending)) return text.substr(0, text.size() - ending.size()) + ".jpg";
  }
  return text;
}

}  // namespace q3d::loaders::formats
