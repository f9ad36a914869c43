#include "loaders/formats/numbered_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "loaders/formats/folded_name.h"

namespace q3d::loaders::formats {
namespace {

std::int64_t number_in(const std::string& row) {
  std::int64_t number = -1;
  std::from_chars(row.data(), row.data() + row.size(), number);
  return number;
}

bool is_picture(const std::filesystem::path& file) {
  const std::string ending = folded_name(file.extension().string());
  return ending == ".jpg" || ending == ".png";
}

}  // namespace

NumberedPictures::NumberedPictures(const std::filesystem::path& folder) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (!is_picture(entry.path())) continue;
    const std::string stem = entry.path().stem().string();
    const std::size_t first = stem.find_last_not_of("0123456789") + 1;  // npos + 1 = 0
    std::int64_t number = 0;
    const char* end = stem.data() + stem.size();
    if (std::from_chars(stem.data() + first, end, number).ec == std::errc()) {
      names_[number].insert(entry.path().filename().string());
    }
  }
}

std::string NumberedPictures::doubt(const std::vector<std::string>& rows) const {
  if (names_.empty()) return {};
  std::set<std::int64_t> frames;
  for (const std::string& row : rows) frames.insert(number_in(row));
  const std::int64_t first = names_.begin()->first;
  const std::int64_t last = names_.rbegin()->first;
  const bool have_all =
      std::all_of(frames.begin(), frames.end(), [&](std::int64_t frame) { return names_.contains(frame); });
  if (have_all && names_.size() == frames.size()) return {};
  const bool are_as_many = names_.size() == frames.size() && names_.size() > 1;
  const bool have_others = std::any_of(names_.begin(), names_.end(),
                                       [&](const auto& each) { return !frames.contains(each.first); });
  const bool are_counted_from_1 =
      first == 1 && names_.size() > 1 && last == static_cast<std::int64_t>(names_.size());
  if (!are_counted_from_1 && (have_all || (!are_as_many && !have_others))) return {};
  return fmt::format("{} frames numbered {} to {} and {} pictures numbered {} to {}", frames.size(),
                     *frames.begin(), *frames.rbegin(), names_.size(), first, last);
}

bool NumberedPictures::may_be_every_nth(const std::vector<std::string>& rows) const {
  const std::set<std::string> frames(rows.begin(), rows.end());
  return names_.size() > 1 && names_.size() < frames.size() && names_.begin()->first == 0 &&
         names_.rbegin()->first + 1 == static_cast<std::int64_t>(names_.size());
}

std::string NumberedPictures::name_of(const std::string& row, int first_frame) const {
  const auto found = names_.find(number_in(row) + first_frame);
  return found == names_.end() || found->second.size() != 1 ? row : *found->second.begin();
}

}  // namespace q3d::loaders::formats
