#include "loaders/formats/deeplabcut_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>

#include "manifests/text_file.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "CollectedData_";
constexpr std::array<std::string_view, 2> kBackupEndings{"singleanimal", "windows"};

// The files of one folder by their names without extension.
using Labels = std::map<std::string, fs::path>;

std::map<fs::path, Labels> labels_by_folder(const fs::path& folder) {
  std::map<fs::path, Labels> found;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const fs::path& path = entry.path();
    const bool is_hdf5 = path.extension() == ".h5";
    const bool is_labels =
        path.filename().string().starts_with(kPrefix) && (is_hdf5 || path.extension() == ".csv");
    if (!is_labels || !entry.is_regular_file()) continue;
    fs::path& file = found[path.parent_path()][path.stem().string()];
    if (file.empty() || is_hdf5) file = path;
  }
  return found;
}

std::string trimmed(std::string_view text) {
  constexpr std::string_view kAround = " \t\r'\"";
  const std::size_t first = text.find_first_not_of(kAround);
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(kAround) - first + 1));
}

// Returns the scorer of a project's config.yaml. It is a plain text on a line of its own, as DeepLabCut
// writes it, so no YAML parser is needed.
std::optional<std::string> scorer_in(const fs::path& config) {
  if (!fs::is_regular_file(config)) return std::nullopt;
  const std::string text = manifests::read_text_file(config, "a project's config.yaml");
  constexpr std::string_view kKey = "scorer:";
  for (std::size_t at = 0; at < text.size();) {
    const std::string_view line = std::string_view(text).substr(at, text.find('\n', at) - at);
    at += line.size() + 1;
    if (!line.starts_with(kKey)) continue;
    return trimmed(line.substr(kKey.size(), line.find(" #") - kKey.size()));
  }
  return std::nullopt;
}

// Looks for config.yaml in a folder and above it, as far as `root`.
std::optional<std::string> project_scorer(fs::path folder, const fs::path& root) {
  folder = fs::weakly_canonical(folder);
  const fs::path last = fs::weakly_canonical(root);
  while (true) {
    if (auto scorer = scorer_in(folder / "config.yaml")) return scorer;
    if (folder == last || folder == folder.parent_path() ||
        std::mismatch(last.begin(), last.end(), folder.begin(), folder.end()).first != last.end()) {
      return std::nullopt;
    }
    folder = folder.parent_path();
  }
}

bool is_backup(const std::string& name, const Labels& labels) {
  return std::any_of(kBackupEndings.begin(), kBackupEndings.end(), [&](std::string_view ending) {
    return name.ends_with(ending) && labels.contains(name.substr(0, name.size() - ending.size()));
  });
}

// Returns the name of the file to take, or nothing if several remain.
std::optional<std::string> chosen(const fs::path& folder, const fs::path& root, const Labels& labels) {
  if (labels.size() == 1) return labels.begin()->first;
  if (const auto scorer = project_scorer(folder, root)) {
    const std::string name = std::string(kPrefix) + *scorer;
    if (labels.contains(name)) return name;
  }
  std::vector<std::string> left;
  for (const auto& [name, file] : labels) {
    if (!is_backup(name, labels)) left.push_back(name);
  }
  return left.size() == 1 ? std::optional(left.front()) : std::nullopt;
}

}  // namespace

std::vector<fs::path> project_label_files(const fs::path& folder, const fs::path& root, Notes& notes) {
  std::vector<fs::path> files;
  for (const auto& [where, labels] : labels_by_folder(folder)) {
    const auto name = chosen(where, root, labels);
    std::vector<std::string> others;
    for (const auto& [other, file] : labels) {
      if (other != name) others.push_back(file.filename().string());
    }
    if (!name) {
      throw std::runtime_error(fmt::format(
          "{}: got several files of labels: {}; expected one. Name the scorer in the project's config.yaml "
          "(scorer: ...), name one file in \"annotations\", or move the others away",
          where.string(), fmt::join(others, ", ")));
    }
    files.push_back(labels.at(*name));
    if (others.empty()) continue;
    notes.add(fmt::format("{}: {} is read, and {} beside it is left out", where.string(),
                          files.back().filename().string(), fmt::join(others, ", ")),
              NoteKind::caution);
  }
  if (!files.empty()) return files;
  throw std::runtime_error(fmt::format(
      "{}: got a folder without labels, expected DeepLabCut's CollectedData_*.h5 or .csv in or below it",
      folder.string()));
}

}  // namespace q3d::loaders::formats
