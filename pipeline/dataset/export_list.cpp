#include "pipeline/dataset/export_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <system_error>
#include <tuple>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/file_name.h"
#include "manifests/json_parse.h"
#include "pipeline/run/log.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kFormat = "quadruped3d-listed-export";
// These members of an export's manifest decide its bytes. Every program that writes exports has them.
constexpr std::array<const char*, 5> kKeyParts{"export", "code", "key", "content_id", "pictures_anyway"};
// An unfinished export describes itself in one of these files: the first is this program's, the second the
// Python package's.
constexpr std::array<const char*, 2> kUnfinished{".parts/about.json", "export.journal"};

fs::path list_folder(const fs::path& out) {
  return out / "stages" / "exports";
}

std::optional<ListedExport> read_entry(const fs::path& file) {
  const json entry = manifests::parse_json_or_null<json>(manifests::read_file(file));
  try {
    const bool is_folder = entry.at("folder").get<std::string>().find('\0') == std::string::npos;
    if (entry.at("format") == kFormat && is_folder) {
      return ListedExport{entry.at("export").get<std::string>(), entry.at("version").get<std::string>(),
                          entry.at("content_id").get<std::string>(), entry.at("pictures_anyway").get<bool>(),
                          entry.at("folder").get<std::string>()};
    }
  } catch (const json::exception&) {
    // The code below reports it like any other unusable content.
  }
  run::log_warning(
      fmt::format("{}: damaged: it is no entry of the list of exports; the next run of its "
                  "`export` writes it anew",
                  file.string()));
  return std::nullopt;
}

// Returns the object in a file, or in its first line; null if there is none.
json first_object(const fs::path& file) {
  if (!fs::is_regular_file(file)) return nullptr;
  const std::string text = manifests::read_file(file);
  json object = manifests::parse_json_or_null<json>(text);
  if (!object.is_object()) object = manifests::parse_json_or_null<json>(text.substr(0, text.find('\n')));
  return object.is_object() ? object : json(nullptr);
}

bool is_of(const json& about, const ListedExport& listed) {
  return about.is_object() && about.value("export", json()) == listed.format &&
         about.value("content_id", json()) == listed.content_id &&
         about.value("pictures_anyway", json()) == listed.pictures_anyway;
}

std::string key_of(const json& about) {
  json parts = json::object();
  for (const char* part : kKeyParts) parts[part] = about.value(part, json());
  return manifests::sha256(parts.dump());
}

// Returns whether an entry of an export's manifest names a file below the folder with the listed size.
bool is_there(const json& entry, const fs::path& folder, std::string& name) {
  if (!entry.is_object() || !entry.value("file", json()).is_string()) return false;
  name = entry.at("file").get<std::string>();
  if (!manifests::leads_below(name)) return false;
  std::error_code error;
  const std::uintmax_t size = fs::file_size(folder / name, error);
  return !error && entry.value("bytes", json()) == size;
}

std::vector<std::string> damaged_files(const json& manifest, const fs::path& folder) {
  std::vector<std::string> damaged;
  for (const char* list : {"files", "picture_files"}) {
    const json files = manifest.value(list, json());
    if (files.is_null()) continue;
    if (!files.is_array()) return {"export.json"};
    for (const json& entry : files) {
      std::string name = "export.json";
      if (!is_there(entry, folder, name)) damaged.push_back(name);
    }
  }
  return damaged;
}

ExportStatus status_of(ListedExport listed, const fs::path& out) {
  ExportStatus status;
  const fs::path folder = out / listed.folder;
  const json manifest = first_object(folder / "export.json");
  if (is_of(manifest, listed)) {
    status.key = key_of(manifest);
    status.damaged = damaged_files(manifest, folder);
    status.state = status.damaged.empty() ? ExportState::complete : ExportState::damaged;
  } else if (manifest.is_null()) {
    for (const char* name : kUnfinished) {
      const json about = first_object(folder / name);
      if (!is_of(about, listed)) continue;
      status.key = key_of(about);
      status.state = ExportState::unfinished;
    }
  }
  status.listed = std::move(listed);
  return status;
}

}  // namespace

void list_export(const PublishedDataset& dataset, const std::string& format, bool pictures_anyway,
                 const fs::path& folder) {
  const fs::path out = dataset.output_folder();
  const fs::path relative = fs::weakly_canonical(folder).lexically_relative(out);
  const json entry = {{"format", kFormat},
                      {"export", format},
                      {"version", dataset.version_name()},
                      {"content_id", dataset.manifest().content_id},
                      {"pictures_anyway", pictures_anyway},
                      {"folder", relative.string()}};
  const std::string text = entry.dump(2) + "\n";
  constexpr std::size_t kDigits = 12;
  const fs::path file =
      list_folder(out) /
      fmt::format("{}-{}.json", format, manifests::sha256(relative.string()).substr(0, kDigits));
  try {
    if (fs::exists(file) && manifests::read_file(file) == text) return;
    fs::create_directories(file.parent_path());
    manifests::remove_temporaries(file.parent_path());
    manifests::write_file_atomically(file, text);
  } catch (const std::exception& error) {
    run::log_note(fmt::format("`status` will not list this export: {}", error.what()));
  }
}

std::vector<ExportStatus> listed_exports(const fs::path& out) {
  std::vector<ExportStatus> exports;
  if (!fs::exists(list_folder(out))) return exports;
  for (const auto& file : fs::directory_iterator(list_folder(out))) {
    if (file.path().extension() != ".json") continue;
    if (auto listed = read_entry(file.path())) exports.push_back(status_of(std::move(*listed), out));
  }
  std::sort(exports.begin(), exports.end(), [](const ExportStatus& a, const ExportStatus& b) {
    return std::tie(a.listed.format, a.listed.folder) < std::tie(b.listed.format, b.listed.folder);
  });
  return exports;
}

}  // namespace q3d::pipeline::dataset
