#include "pipeline/candidates/local_folders.h"

#include <algorithm>
#include <string_view>
#include <system_error>

#include "manifests/valid_utf8.h"

namespace q3d::pipeline::candidates {
namespace {

namespace fs = std::filesystem;

// A path in a sentence begins behind one of these characters and ends before one of those below, so that a
// path within a longer one or within a URL is left alone.
constexpr std::string_view kBefore = " \t\n\"'(<[=:,;";
constexpr std::string_view kAfter = " \t\n\"')>]:,;";

}  // namespace

LocalFolders::LocalFolders(const loaders::formats::DatasetOptions& options) {
  add(options.root, "the root");
  if (!options.images.empty()) add(options.root / options.images, "the folder of pictures");
  if (options.annotations.is_absolute()) {
    add(options.annotations.parent_path(), "the folder of the annotations");
  }
}

void LocalFolders::add(const fs::path& folder, const std::string& name) {
  std::error_code error;
  const fs::path resolved = fs::canonical(folder, error);
  if (error) return;
  for (const fs::path& path : {folder, folder.lexically_normal(), resolved}) add_path(path, name);
}

void LocalFolders::add_path(const fs::path& folder, const std::string& name) {
  std::string path = manifests::valid_utf8(folder.string());  // as details and notes have it
  while (path.size() > 1 && path.back() == '/') path.pop_back();
  const bool is_known =
      std::any_of(folders_.begin(), folders_.end(), [&](const Folder& known) { return known.path == path; });
  if (path.empty() || path == "/" || is_known) return;
  // A relative path may be a word of the sentence.
  folders_.push_back({std::move(path), folder.is_absolute() ? name : std::string()});
}

std::string LocalFolders::without(std::string text) const {
  for (const Folder& folder : folders_) {
    std::size_t at = text.find(folder.path);
    while (at != std::string::npos) at = text.find(folder.path, replace_at(at, folder, text));
  }
  return text;
}

// Replaces the folder's path at this place, if a path begins there that is the folder's or lies below it.
// Returns the place behind what was looked at.
std::size_t LocalFolders::replace_at(std::size_t at, const Folder& folder, std::string& text) {
  const std::size_t end = at + folder.path.size();
  const bool has_slash = end < text.size() && text[end] == '/';
  const std::size_t last = has_slash ? end + 1 : end;
  const bool begins = at == 0 || kBefore.find(text[at - 1]) != std::string_view::npos;
  const bool is_whole = last == text.size() || kAfter.find(text[last]) != std::string_view::npos;
  const bool is_named = is_whole && !folder.name.empty();
  if (!begins || (!is_named && (!has_slash || is_whole))) return end;
  const std::string name = is_named ? folder.name : std::string();
  text.replace(at, last - at, name);
  return at + name.size();
}

}  // namespace q3d::pipeline::candidates
