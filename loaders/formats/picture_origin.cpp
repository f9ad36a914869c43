#include "loaders/formats/picture_origin.h"

#include <algorithm>
#include <cctype>

namespace q3d::loaders::formats {
namespace {

std::size_t digits_at(std::string_view text, std::size_t at) {
  std::size_t count = 0;
  while (at + count < text.size() && std::isdigit(static_cast<unsigned char>(text[at + count])) != 0) ++count;
  return count;
}

// Returns whether the text ends at this position, or continues with '_'.
bool ends_at(std::string_view text, std::size_t at) {
  return at >= text.size() || text[at] == '_';
}

}  // namespace

std::string picture_origin(std::string_view file_name) {
  std::string stem(file_name.substr(file_name.find_last_of("/\\") + 1));  // npos + 1 = 0
  stem.resize(std::min(stem.rfind('.'), stem.size()));
  std::transform(stem.begin(), stem.end(), stem.begin(), [](unsigned char c) { return std::tolower(c); });
  const std::size_t first = digits_at(stem, 0);
  if (stem.starts_with('n') && digits_at(stem, 1) == 8 && stem.size() > 9 && stem[9] == '_') {
    const std::size_t number = digits_at(stem, 10);
    return number > 0 && ends_at(stem, 10 + number) ? "imagenet " + stem.substr(0, 10 + number) : "";
  }
  if (first == 0 || first + 1 >= stem.size() || stem[first] != '_') return "";
  const std::size_t second = digits_at(stem, first + 1);
  if (first == 12 && second == 0) return "coco " + stem.substr(0, 12);
  if (first == 4 && second == 6 && ends_at(stem, 11)) return "voc " + stem.substr(0, 11);
  return "";
}

}  // namespace q3d::loaders::formats
