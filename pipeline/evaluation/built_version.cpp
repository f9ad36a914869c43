#include "pipeline/evaluation/built_version.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <vector>

#include "manifests/digest.h"
#include "pipeline/dataset/dataset_manifest.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

std::set<std::string> dataset_names(const config::BuildConfig& config) {
  std::set<std::string> names;
  for (const config::DatasetConfig& dataset : config.datasets)
    names.insert(dataset.name + "/" + dataset.split);
  return names;
}

std::set<std::string> dataset_names(const json& annotations) {
  std::set<std::string> names;
  for (const auto& [name, digest] : annotations.items()) names.insert(name);
  return names;
}

// Returns the SHA-256 of a list that the config may name, or null.
json digest_of(const fs::path& file) {
  return file.empty() ? json() : json(manifests::sha256_file(file));
}

// Returns the digest of that list in dataset.json, or null. Versions before 0.3 have no corrections.
json built_digest(const json& provenance, const char* list) {
  const json built = provenance.value(list, json());
  return built.is_null() ? built : built.at("sha256");
}

// Returns whether dataset.json describes a build with this config. `veto` and `corrections` are the digests
// of the config's lists.
bool is_of(const json& document, const config::BuildConfig& config, const stages::StageKeys& keys,
           const json& veto, const json& corrections) {
  const json& provenance = document.at("provenance");
  return document.at("name") == config.name && document.at("version") == config.version &&
         provenance.at("stage_keys").at("shards") == keys.shards &&
         dataset_names(provenance.at("annotations")) == dataset_names(config) &&
         built_digest(provenance, "veto") == veto && built_digest(provenance, "corrections") == corrections &&
         provenance.at("leakage").is_null() == !config.leakage.has_value();
}

std::vector<BuiltVersion> built_versions(const config::BuildConfig& config, const stages::StageKeys& keys,
                                         const fs::path& out) {
  const json veto = digest_of(config.veto);
  const json corrections = digest_of(config.corrections);
  std::vector<BuiltVersion> versions;
  for (const fs::directory_entry& entry : fs::directory_iterator(out)) {
    const fs::path file = entry.path() / "dataset.json";
    if (entry.is_symlink() || !fs::exists(file)) continue;
    try {
      const json document = dataset::read_dataset_document(entry.path());
      if (!is_of(document, config, keys, veto, corrections)) continue;
      versions.push_back({entry.path(), document.at("content_id").get<std::string>()});
    } catch (const json::exception& error) {
      throw std::runtime_error(
          fmt::format("{}: not a readable dataset.json: {}", file.string(), error.what()));
    }
  }
  return versions;
}

}  // namespace

BuiltVersion find_built_version(const config::BuildConfig& config, const stages::StageKeys& keys,
                                const fs::path& out) {
  const std::vector<BuiltVersion> versions = built_versions(config, keys, out);
  if (versions.empty()) {
    throw std::runtime_error(
        fmt::format("{}: there is no finished dataset of this config; run `build` with the same config and "
                    "output folder first",
                    out.string()));
  }
  if (versions.size() == 1) return versions.front();
  std::error_code error;
  const fs::path latest = fs::canonical(out / "latest", error);
  const auto newest = std::find_if(versions.begin(), versions.end(), [&](const BuiltVersion& version) {
    return !error && fs::canonical(version.folder) == latest;
  });
  if (newest != versions.end()) return *newest;
  throw std::runtime_error(fmt::format(
      "{}: {} finished datasets were built with this config from other pictures, and `latest` points "
      "to none of them; run `build` with the same config, which points `latest` to its dataset",
      out.string(), versions.size()));
}

}  // namespace q3d::pipeline::evaluation
