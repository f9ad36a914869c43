#include "loaders/curation/clip.h"

#include <algorithm>
#include <cctype>

namespace q3d::loaders::curation {
namespace {

bool is_digit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

std::size_t start_of_base(std::string_view file_name) {
  return file_name.find_last_of("/\\") + 1;  // npos + 1 = 0
}

}  // namespace

std::string source_stem(std::string_view file_name) {
  std::string stem(file_name.substr(start_of_base(file_name)));
  stem.resize(std::min(stem.rfind('.'), stem.size()));
  const std::size_t bar = stem.rfind('_');
  const bool has_id = bar != std::string::npos && bar > 0 && bar + 1 < stem.size() &&
                      std::all_of(stem.begin() + static_cast<std::ptrdiff_t>(bar) + 1, stem.end(), is_digit);
  if (has_id) stem.resize(bar);
  return stem;
}

std::string clip_of_frame(std::string_view file_name) {
  std::string clip = source_stem(file_name);
  while (!clip.empty() && is_digit(clip.back())) clip.pop_back();
  while (!clip.empty() && (clip.back() == '_' || clip.back() == '-' || clip.back() == ' ')) clip.pop_back();
  std::string folder(file_name.substr(0, start_of_base(file_name)));
  std::replace(folder.begin(), folder.end(), '\\', '/');
  if (clip.empty() && !folder.empty()) folder.pop_back();
  return folder + clip;
}

}  // namespace q3d::loaders::curation
