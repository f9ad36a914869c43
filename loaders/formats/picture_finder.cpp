#include "loaders/formats/picture_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <stdexcept>
#include <system_error>
#include <utility>

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

bool climbs_out(const fs::path& normal) {
  return !normal.empty() && *normal.begin() == "..";
}

// Returns the same text for paths that people would call the same: regardless of case, '+' for a space, and
// .jpeg or .jpe for .jpg.
std::string folded(const fs::path& path) {
  std::string text = path.generic_string();
  for (char& c : text) c = c == '+' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const std::string_view ending : {".jpeg", ".jpe"}) {
    if (text.ends_with(ending)) return text.substr(0, text.size() - ending.size()) + ".jpg";
  }
  return text;
}

// An error that says nothing about whether the file is there must not make its picture a missing one.
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

PictureFinder::PictureFinder(const fs::path& root, const fs::path& images, const fs::path& default_images) {
  const fs::path resolved_root = resolved_folder(root, "dataset root");
  allowed_.push_back(resolved_root);
  if (!images.empty()) {
    bases_.push_back(resolved_folder(resolved_root / images, "folder of pictures"));
    allowed_.push_back(bases_.front());
  } else if (!default_images.empty() && fs::is_directory(resolved_root / default_images)) {
    bases_.push_back(resolved_root / default_images);
  }
  if (bases_.empty() || bases_.front() != resolved_root) bases_.push_back(resolved_root);
  images_name_ = bases_.front().filename().string();
}

FoundPicture PictureFinder::find(const std::string& name) {
  if (name.empty() || name.size() > kMaxNameLength || name.find('\0') != std::string::npos) {
    return {{}, Reason::record_malformed, fmt::format("a name of {} bytes", name.size())};
  }
  const fs::path normal = fs::path(name).lexically_normal();
  return normal.is_absolute() ? find_absolute(normal) : find_relative(normal);
}

FoundPicture PictureFinder::find_relative(const fs::path& name) {
  if (climbs_out(name)) {
    return {{}, Reason::path_escapes_root, fmt::format("{}, which leaves the root", name.string())};
  }
  if (auto found = below_bases(name)) return std::move(*found);
  std::optional<FoundPicture> found = by_spelling(name);
  if (!found && *name.begin() == images_name_) found = by_spelling(without_first(name));
  if (found) return std::move(*found);
  return {{},
          Reason::image_missing,
          fmt::format("{}, which is not below {}", name.string(), bases_.front().string())};
}

FoundPicture PictureFinder::find_absolute(const fs::path& name) {
  if (std::any_of(allowed_.begin(), allowed_.end(),
                  [&](const fs::path& folder) { return lies_in(name, folder); })) {
    if (auto found = existing(name)) return std::move(*found);
  }
  for (fs::path tail = name.relative_path(); !tail.empty(); tail = without_first(tail)) {
    if (auto found = below_bases(tail)) {
      if (found->failure == Reason::none) {
        ++found_by_tail_;
        const auto known = name_of_tail_.emplace(found->path.string(), name.string());
        if (!known.second && known.first->second != name) ++shared_files_;
      }
      return std::move(*found);
    }
  }
  for (fs::path tail = name.relative_path(); !tail.empty(); tail = without_first(tail)) {
    if (auto found = by_spelling(tail)) return std::move(*found);
  }
  return {{},
          Reason::path_escapes_root,
          fmt::format("{}, which is outside the root, and no file of its name is below {}", name.string(),
                      bases_.front().string())};
}

std::optional<FoundPicture> PictureFinder::below_bases(const fs::path& relative) {
  for (const fs::path& base : bases_) {
    if (auto found = existing(base / relative)) return found;
  }
  return std::nullopt;
}

std::optional<FoundPicture> PictureFinder::by_spelling(const fs::path& relative) {
  if (!spellings_) {
    spellings_.emplace();
    std::error_code error;
    const auto options = fs::directory_options::skip_permission_denied;
    for (fs::recursive_directory_iterator it(bases_.front(), options, error), end; !error && it != end;
         it.increment(error)) {
      std::error_code ignored;
      if (!it->is_directory(ignored)) {
        (*spellings_)[folded(it->path().lexically_relative(bases_.front()))].push_back(it->path());
      }
    }
    require_answer(error, "list", bases_.front());
  }
  const auto found = spellings_->find(folded(relative));
  if (found == spellings_->end()) return std::nullopt;
  if (found->second.size() > 1) {
    return FoundPicture{{},
                        Reason::image_missing,
                        fmt::format("{}, which could be {} or {}", relative.string(),
                                    found->second[0].string(), found->second[1].string())};
  }
  std::optional<FoundPicture> picture = existing(found->second.front());
  if (picture && picture->failure == Reason::none) ++found_by_spelling_;
  return picture;
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
      return FoundPicture{{}, Reason::image_missing, fmt::format("{}, a link to nothing", path.string())};
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
  if (!is_allowed(resolved)) {
    return FoundPicture{{},
                        Reason::path_escapes_root,
                        fmt::format("{}, a link to {} outside the root", path.string(), resolved.string())};
  }
  return FoundPicture{resolved, Reason::none, {}};
}

bool PictureFinder::is_allowed(const fs::path& resolved) const {
  return std::any_of(allowed_.begin(), allowed_.end(),
                     [&](const fs::path& folder) { return lies_in(resolved, folder); });
}

std::string id_part(std::string_view name) {
  const fs::path normal = fs::path(name).lexically_normal();
  std::string part =
      normal.is_absolute() || climbs_out(normal) ? normal.filename().string() : normal.generic_string();
  std::replace_if(
      part.begin(), part.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '_');
  return part;
}

}  // namespace q3d::loaders::formats
