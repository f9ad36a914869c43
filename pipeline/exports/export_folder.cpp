#include "pipeline/exports/export_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/file_name.h"
#include "manifests/json_parse.h"
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
    return manifests::parse_json<ordered_json>(manifests::read_file(file));
  } catch (const manifests::IoError&) {
    throw;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: not readable JSON: {}; remove its folder and export again",
                                         file.string(), error.what()));
  }
}

// Returns the pictures of a part as one line: {"NAME": [BYTES, "SHA-256"], ...}.
std::string line_of(const ExportFolder::Files& pictures) {
  ordered_json line = ordered_json::object();
  for (const auto& [name, file] : pictures) line[name] = {file.bytes, file.sha256};
  return line.dump() + "\n";
}

// Reads that line back, which is the first one of a part.
ExportFolder::Files pictures_of(const std::string& part) {
  ExportFolder::Files pictures;
  const auto line = manifests::parse_json<ordered_json>(part.substr(0, part.find('\n')));
  for (const auto& [name, file] : line.items()) {
    pictures[name] = {file.at(1).get<std::string>(), file.at(0).get<std::size_t>()};
  }
  return pictures;
}

ordered_json list_of(const ExportFolder::Files& files) {
  ordered_json list = ordered_json::array();
  for (const auto& [name, file] : files) {
    list.push_back({{"file", name}, {"bytes", file.bytes}, {"sha256", file.sha256}});
  }
  return list;
}

// Checks the files that a manifest lists. A stranger may have written the manifest. Throws json::exception if
// it has another form.
void check_files(const fs::path& out, const ordered_json& list, const fs::path& manifest) {
  if (!list.is_array()) {
    throw std::runtime_error(fmt::format("{}: got {}, expected a list of files; remove {} and export again",
                                         manifest.string(), list.type_name(), out.string()));
  }
  for (const ordered_json& entry : list) {
    const auto name = entry.at("file").get<std::string>();
    if (!manifests::leads_below(name)) {
      throw std::runtime_error(
          fmt::format("{}: lists {}, expected a file below its folder; remove {} and export again",
                      manifest.string(), ordered_json(name).dump(), out.string()));
    }
    const fs::path path = out / name;
    if (fs::exists(path) && manifests::sha256_file(path) == entry.at("sha256").get<std::string>()) continue;
    throw std::runtime_error(fmt::format("{}: is gone or differs from {}; remove {} and export again",
                                         path.string(), manifest.string(), out.string()));
  }
}

// Removes the temporary files that a killed run left, in the pictures' folders too.
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
  if (complete_) {
    drop_parts();  // the run that completed the export was killed before this step
  } else {
    open_parts();
  }
}

void ExportFolder::check_same(const ordered_json& found, const fs::path& file) const {
  if (!found.is_object()) {
    throw std::runtime_error(fmt::format(
        "{}: got no JSON object, expected what an export writes; remove its folder and export again",
        file.string()));
  }
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
  try {
    check_files(out_, manifest_.at("files"), file);
    check_files(out_, manifest_.at("picture_files"), file);
  } catch (const ordered_json::exception& error) {
    throw std::runtime_error(fmt::format("{}: not what an export writes: {}; remove {} and export again",
                                         file.string(), error.what(), out_.string()));
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

// Returns whether a part and all of its pictures have the bytes that an earlier run wrote.
bool ExportFolder::is_whole(const fs::path& part, const std::string& sha256) const {
  const auto content = manifests::if_present([&] { return manifests::read_file(part); });
  if (!content || manifests::sha256(*content) != sha256) return false;
  const Files pictures = pictures_of(*content);
  return std::all_of(pictures.begin(), pictures.end(), [&](const auto& picture) {
    return manifests::if_present([&] { return manifests::sha256_file(out_ / picture.first); }) ==
           picture.second.sha256;
  });
}

bool ExportFolder::has_part(std::int64_t unit, const std::string& input_digest) {
  const auto entry = journal_->find(unit, input_digest);
  if (!entry) return false;
  if (is_whole(parts_ / entry->file, entry->sha256)) return true;
  journal_->forget(unit);
  return false;
}

ExportFolder::File ExportFolder::write_picture(const std::string& name,
                                               std::span<const std::byte> content) const {
  const fs::path path = out_ / name;
  fs::create_directories(path.parent_path());
  manifests::write_file_atomically(path, content);
  return {manifests::sha256(content), content.size()};
}

void ExportFolder::save_part(std::int64_t unit, const std::string& input_digest, std::int64_t rows,
                             std::string_view text, const Files& pictures) {
  const std::string name = part_name(unit);
  const std::string content = line_of(pictures).append(text);
  manifests::write_file_atomically(parts_ / name, content);
  journal_->append({unit, input_digest, name, manifests::sha256(content),
                    static_cast<std::int64_t>(content.size()), rows});
}

std::string ExportFolder::take_part(std::int64_t unit) {
  const std::string content = manifests::read_file(parts_ / part_name(unit));
  if (manifests::sha256(content) != journal_->entries().at(unit).sha256) {
    throw std::runtime_error(fmt::format("{}: changed while the export ran; run the same command again",
                                         (parts_ / part_name(unit)).string()));
  }
  for (auto& [name, file] : pictures_of(content)) pictures_[name] = std::move(file);
  return content.substr(content.find('\n') + 1);
}

void ExportFolder::write(const std::string& name, std::string_view content) {
  files_[name] = write_picture(name, std::as_bytes(std::span(content)));
}

void ExportFolder::write_common_picture(const std::string& name, std::span<const std::byte> content) {
  pictures_[name] = write_picture(name, content);
}

void ExportFolder::finish(const ordered_json& summary) {
  manifest_ = about_;
  manifest_.update(summary);
  manifest_["files"] = list_of(files_);
  manifest_["picture_files"] = list_of(pictures_);
  manifests::write_file_atomically(out_ / kManifest, manifest_.dump(2) + "\n");
  journal_.reset();
  lock_.reset();
  drop_parts();
  complete_ = true;
}

// Removes the parts durably, so that a power cut cannot bring them back.
void ExportFolder::drop_parts() {
  if (fs::remove_all(parts_) > 0) manifests::sync_folder(out_);
}

}  // namespace q3d::pipeline::exports
