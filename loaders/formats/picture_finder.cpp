#include "loaders/formats/picture_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "loaders/formats/folded_name.h"
#include "manifests/file_descriptor.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using manifests::Reason;

constexpr std::size_t kMaxNameLength = 4096;

fs::path resolved_folder(const fs::path& folder, const char* what) {
  std::error_code error;
  const fs::path resolved = fs::canonical(folder, error);
  if (error || !fs::is_directory(resolved)) {
    throw std::runtime_error(fmt::format("{} {}: got {}, expected a folder", what, folder.string(),
                                         error ? error.message() : "a file"));
  }
  return resolved;
}

bool lies_in(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

// Throws if the error does not say whether the file exists: such a picture must not count as missing.
void require_answer(const std::error_code& error, const char* doing, const fs::path& path) {
  if (error && !manifests::names_no_file(error.value())) {
    throw manifests::IoError(doing, path, error.value());
  }
}

fs::path without_first(const fs::path& path) {
  fs::path rest;
  for (auto part = std::next(path.begin()); part != path.end(); ++part) rest /= *part;
  return rest;
}

}  // namespace

PictureFinder::PictureFinder(const PictureFolders& folders)
    : root_(resolved_folder(folders.root, "dataset root")) {
  allowed_.push_back(root_);
  if (!folders.images.empty()) {
    bases_.push_back(resolved_folder(root_ / folders.images, "folder of pictures"));
    allowed_.push_back(bases_.front());
  } else if (!folders.default_images.empty() && fs::is_directory(root_ / folders.default_images)) {
    bases_.push_back(root_ / folders.default_images);
  }
  if (bases_.empty() || bases_.front() != root_) bases_.push_back(root_);
  std::error_code error;
  const fs::path annotations = fs::canonical(root_ / folders.annotations, error);
  if (error || !lies_in_allowed(annotations)) return;
  annotations_ = annotations;
  if (std::find(bases_.begin(), bases_.end(), annotations) == bases_.end()) bases_.push_back(annotations);
}

FoundPicture PictureFinder::find(const std::string& name) {
  if (name.empty() || name.size() > kMaxNameLength || name.find('\0') != std::string::npos) {
    return {{}, Reason::record_malformed, fmt::format("a name of {} bytes", name.size())};
  }
  const std::vector<NameReading> readings = readings_of(name);
  if (readings.empty()) return {{}, Reason::image_missing, fmt::format("\"{}\", which names no file", name)};
  for (std::size_t i = 0; i < readings.size(); ++i) {
    // find_exactly() already counts a name that leads to the file through "../" or the root's own name. Such
    // a picture must not be counted twice when its reading is not the first.
    const std::size_t counted = found_by_reading_;
    auto found = find_exactly(readings[i]);
    if (!found) continue;
    const bool is_other_reading = i > 0 && !readings[i].is_absolute && found->failure == Reason::none;
    if (is_other_reading && counted == found_by_reading_) ++found_by_reading_;
    return std::move(*found);
  }
  for (const NameReading& reading : readings) {
    if (auto found = find_by_spelling(reading)) return std::move(*found);
  }
  return not_found(readings);
}

std::optional<FoundPicture> PictureFinder::find_in(const fs::path& folder, const std::string& name) {
  std::error_code error;
  const fs::path resolved = fs::canonical(folder, error);
  if (error || !lies_in_allowed(resolved) || name.size() > kMaxNameLength) return std::nullopt;
  for (const NameReading& reading : readings_of(name)) {
    if (auto found = existing(resolved / reading.path.filename())) return found;
  }
  return std::nullopt;
}

fs::path PictureFinder::relative_to_root(const fs::path& path) const {
  std::error_code error;
  const fs::path resolved = fs::canonical(path, error);
  return error || !lies_in(resolved, root_) ? fs::path() : resolved.lexically_relative(root_);
}

std::optional<FoundPicture> PictureFinder::find_exactly(const NameReading& reading) {
  if (reading.is_absolute) return find_absolute(reading);
  if (climbs_out(reading.path)) return find_climbing(reading.path);
  if (auto found = below_bases(reading.path)) return found;
  for (const fs::path& tail : own_tails(reading.path)) {
    auto found = below_bases(tail);
    if (!found) continue;
    if (found->failure == Reason::none) ++found_by_reading_;
    return found;
  }
  return std::nullopt;
}

std::optional<FoundPicture> PictureFinder::find_absolute(const NameReading& reading) {
  const std::string name = "/" + reading.path.string();
  if (reading.is_posix_absolute && lies_in_allowed(name)) {
    if (auto found = existing(name)) return found;
  }
  for (fs::path tail = reading.path; !tail.empty(); tail = without_first(tail)) {
    auto found = below_bases(tail);
    if (!found) continue;
    if (found->failure == Reason::none) {
      ++found_by_tail_;
      const std::uint64_t hash = std::hash<std::string>()(name);
      const auto [file, is_new] = files_of_tails_.add(found->path.native());
      if (is_new) first_names_.push_back(hash);
      if (first_names_[file] != hash) ++shared_files_;
    }
    return found;
  }
  return std::nullopt;
}

std::optional<FoundPicture> PictureFinder::find_climbing(const fs::path& path) {
  std::vector<fs::path> folders = bases_;
  if (!annotations_.empty()) folders.insert(folders.begin(), annotations_);
  for (const fs::path& folder : folders) {
    const fs::path meant = (folder / path).lexically_normal();
    if (!lies_in_allowed(meant)) continue;
    auto found = existing(meant);
    if (!found) continue;
    if (found->failure == Reason::none) ++found_by_reading_;
    return found;
  }
  return std::nullopt;
}

// Returns the parts of a path that follow the name of the root, or of the folder of pictures.
std::vector<fs::path> PictureFinder::own_tails(const fs::path& path) const {
  std::vector<fs::path> tails;
  for (fs::path rest = path; std::distance(rest.begin(), rest.end()) > 1;) {
    const fs::path first = *rest.begin();
    rest = without_first(rest);
    if (first == root_.filename() || first == bases_.front().filename()) tails.push_back(rest);
  }
  return tails;
}

std::optional<FoundPicture> PictureFinder::find_by_spelling(const NameReading& reading) {
  if (reading.is_absolute) {
    for (fs::path tail = reading.path; !tail.empty(); tail = without_first(tail)) {
      if (auto found = by_spelling(tail)) return found;
    }
    return std::nullopt;
  }
  if (climbs_out(reading.path)) return std::nullopt;
  if (auto found = by_spelling(reading.path)) return found;
  for (const fs::path& tail : own_tails(reading.path)) {
    if (auto found = by_spelling(tail)) return found;
  }
  return std::nullopt;
}

// A POSIX path that is absolute or climbs out is an escape; every other name is that of a missing picture.
FoundPicture PictureFinder::not_found(const std::vector<NameReading>& readings) const {
  for (const NameReading& reading : readings) {
    if (!reading.is_absolute && climbs_out(reading.path)) {
      return {{},
              Reason::path_escapes_root,
              fmt::format("{}, which leaves the root or names nothing in it", reading.path.string())};
    }
  }
  const NameReading& first = readings.front();
  if (first.is_posix_absolute) {
    return {{},
            Reason::path_escapes_root,
            fmt::format("/{}, which is outside the root, and no file of its name is below {}",
                        first.path.string(), name_for_people(bases_.front()))};
  }
  return {{},
          Reason::image_missing,
          fmt::format("{}, which is not below {}", first.path.string(), name_for_people(bases_.front()))};
}

std::optional<FoundPicture> PictureFinder::below_bases(const fs::path& relative) {
  for (const fs::path& base : bases_) {
    if (auto found = existing(base / relative)) return found;
  }
  return std::nullopt;
}

const PictureFinder::Spellings& PictureFinder::spellings_below(const fs::path& base) {
  const auto [known, is_new] = spellings_.try_emplace(base);
  if (!is_new) return known->second;
  std::error_code error;
  const auto options = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(base, options, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_directory(ignored)) continue;
    known->second[folded_name(it->path().lexically_relative(base).generic_string())].push_back(it->path());
  }
  require_answer(error, "list", base);
  return known->second;
}

std::optional<FoundPicture> PictureFinder::by_spelling(const fs::path& relative) {
  const std::string folded = folded_name(relative.generic_string());
  for (const fs::path& base : bases_) {
    const Spellings& spellings = spellings_below(base);
    const auto found = spellings.find(folded);
    if (found == spellings.end()) continue;
    if (found->second.size() > 1) {
      const auto [first, last] = std::minmax_element(found->second.begin(), found->second.end());
      return FoundPicture{{},
                          Reason::image_missing,
                          fmt::format("{}, which could be {} or {}", relative.string(),
                                      name_for_people(*first), name_for_people(*last))};
    }
    std::optional<FoundPicture> picture = existing(found->second.front());
    if (picture && picture->failure == Reason::none) ++found_by_spelling_;
    if (picture) return picture;
  }
  return std::nullopt;
}

// Returns nothing if there is no such file, and a failure if it must not or cannot be read.
std::optional<FoundPicture> PictureFinder::existing(const fs::path& path) {
  std::error_code error;
  const fs::file_status own = fs::symlink_status(path, error);
  require_answer(error, "inspect", path);
  if (error || !fs::exists(own) || fs::is_directory(own)) return std::nullopt;
  fs::path resolved;
  if (fs::is_symlink(own)) {
    resolved = fs::canonical(path, error);
    require_answer(error, "resolve the link", path);
    if (error) {
      return FoundPicture{
          {}, Reason::image_missing, fmt::format("{}, a link to nothing", name_for_people(path))};
    }
    if (fs::is_directory(resolved, error)) return std::nullopt;
  } else {
    // Most pictures share few folders, so resolving each folder once saves one system call for each path
    // component.
    fs::path& folder = resolved_folders_[path.parent_path().string()];
    if (folder.empty()) folder = fs::canonical(path.parent_path(), error);
    require_answer(error, "resolve", path.parent_path());
    resolved = folder / path.filename();
  }
  if (!lies_in_allowed(resolved)) {
    return FoundPicture{{},
                        Reason::path_escapes_root,
                        fmt::format("{}, a link that leads outside the root", name_for_people(path))};
  }
  return FoundPicture{resolved, Reason::none, {}};
}

// Names a path without the folders of this machine, since the text becomes part of a dataset.
std::string PictureFinder::name_for_people(const fs::path& path) const {
  for (const fs::path& folder : allowed_) {
    if (!lies_in(path, folder)) continue;
    const std::string relative = path.lexically_relative(folder).generic_string();
    if (relative != ".") return relative;
    return folder == root_ ? "the root" : "the folder of pictures";
  }
  return path.string();
}

bool PictureFinder::lies_in_allowed(const fs::path& path) const {
  return std::any_of(allowed_.begin(), allowed_.end(),
                     [&](const fs::path& folder) { return lies_in(path, folder); });
}

}  // namespace q3d::loaders::formats
