#include "pipeline/exports/export_folder.h"

#include <fmt/format.h>

#include <stdexcept>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::exports {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kManifest = "export.json";

std::string part_name(std::int64_t unit) {
  return fmt::format("unit-{:06}.jsonl", unit);
}

ordered_json read_json(const fs::path& file) {
  try {
    return ordered_json::parse(manifests::read_file(file));
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(fmt::format("{}: not readable JSON: {}; remove its folder and export again",
                                         file.string(), error.what()));
  }
}

// What a run that was killed left, the pictures' folders included.
void remove_all_temporaries(const fs::path& out) {
  std::vector<fs::path> folders{out};
  for (const auto& entry : fs::recursive_directory_iterator(out)) {
    if (entry.is_directory()) folders.push_back(entry.path());
  }
  for (const fs::path& folder : folders) manifests::remove_temporaries(folder);
}

}  // namespace

ExportFolder::ExportFolder(fs::path out, ordered_json about)
    : out_(std::move(out)), parts_(out_ / ".parts"), about_(std::move(about)) {
  complete_ = open_complete();
  if (!complete_) open_parts();
}

void ExportFolder::check_same(const ordered_json& found, const fs::path& file) const {
  for (const auto& [key, value] : about_.items()) {
    const auto at = found.find(key);
    if (at != found.end() && *at == value) continue;
    throw run::ConfigError(fmt::format("{}: is another export: {} is {}, now {}; choose another folder",
                                       file.string(), key, at == found.end() ? "absent" : at->dump(),
                                       value.dump()));
  }
}

bool ExportFolder::open_complete() {
  const fs::path file = out_ / kManifest;
  if (!fs::exists(file)) return false;
  manifest_ = read_json(file);
  check_same(manifest_, file);
  for (const ordered_json& entry : manifest_.at("files")) {
    const fs::path path = out_ / entry.at("file").get<std::string>();
    if (fs::exists(path) && manifests::sha256_file(path) == entry.at("sha256").get<std::string>()) continue;
    throw std::runtime_error(fmt::format("{}: is gone or differs from {}; remove {} and export again",
                                         path.string(), file.string(), out_.string()));
  }
  return true;
}

void ExportFolder::open_parts() {
  const fs::path about_file = parts_ / "about.json";
  if (!fs::exists(parts_) && fs::exists(out_) && !fs::is_empty(out_)) {
    throw run::ConfigError(
        fmt::format("{}: holds other files; choose a folder that is empty or does not exist", out_.string()));
  }
  fs::create_directories(parts_);
  lock_ = std::make_unique<manifests::FolderLock>(parts_);
  if (fs::exists(about_file)) {
    check_same(read_json(about_file), about_file);
  } else {
    manifests::write_file_atomically(about_file, about_.dump());
  }
  remove_all_temporaries(out_);
  journal_ = std::make_unique<manifests::Journal>(parts_ / "journal.jsonl");
}

bool ExportFolder::has_part(std::int64_t unit, const std::string& input_digest) {
  const auto entry = journal_->find(unit, input_digest);
  if (!entry) return false;
  const fs::path file = parts_ / entry->file;
  if (fs::exists(file) && manifests::sha256_file(file) == entry->sha256) return true;
  journal_->forget(unit);
  return false;
}

void ExportFolder::save_part(std::int64_t unit, const std::string& input_digest, std::int64_t rows,
                             std::string_view text) {
  const std::string name = part_name(unit);
  manifests::write_file_atomically(parts_ / name, text);
  journal_->append(
      {unit, input_digest, name, manifests::sha256(text), static_cast<std::int64_t>(text.size()), rows});
}

std::string ExportFolder::part(std::int64_t unit) const {
  std::string text = manifests::read_file(parts_ / part_name(unit));
  if (manifests::sha256(text) == journal_->entries().at(unit).sha256) return text;
  throw std::runtime_error(fmt::format("{}: changed while the export ran; run the same command again",
                                       (parts_ / part_name(unit)).string()));
}

void ExportFolder::write(const std::string& name, std::string_view content) {
  const fs::path path = out_ / name;
  fs::create_directories(path.parent_path());
  manifests::write_file_atomically(path, content);
  files_[name] = {manifests::sha256(content), content.size()};
}

void ExportFolder::finish(const ordered_json& summary) {
  manifest_ = about_;
  manifest_.update(summary);
  manifest_["files"] = ordered_json::array();
  for (const auto& [name, file] : files_) {
    manifest_["files"].push_back({{"file", name}, {"bytes", file.bytes}, {"sha256", file.sha256}});
  }
  manifests::write_file_atomically(out_ / kManifest, manifest_.dump(2) + "\n");
  journal_.reset();
  lock_.reset();
  fs::remove_all(parts_);
  complete_ = true;
}

}  // namespace q3d::pipeline::exports
