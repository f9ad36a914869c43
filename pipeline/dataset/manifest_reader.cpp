#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "manifests/dataset_document.h"
#include "manifests/file_name.h"
#include "manifests/json_number.h"
#include "manifests/shard.h"
#include "pipeline/dataset/dataset_manifest.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using json = nlohmann::ordered_json;
using manifests::whole_number;
using manifests::whole_number_at;

std::string text_of(const json& value) {
  return value.is_null() ? std::string() : value.get<std::string>();
}

// Checks a text that becomes part of a folder's name: the dataset's name, or a stage's key. The author of a
// dataset.json must not be able to choose another folder with it.
std::string name_of(const char* what, std::string text) {
  if (manifests::is_file_name(text)) return text;
  throw std::runtime_error(fmt::format(
      "{} is {}, expected a name without '/', '\\\\', ':' and control characters", what, json(text).dump()));
}

// Returns the key of a stage, which is null in the file if there is no such stage.
std::string key_of_stage(const json& keys, const char* stage) {
  const std::string key = text_of(keys.at(stage));
  return key.empty() ? key : name_of(stage, key);
}

Counts counts_of(const json& counts) {
  return {whole_number_at(counts, "candidates"), whole_number_at(counts, "retained"),
          whole_number_at(counts, "refined"), whole_number_at(counts, "discarded"),
          whole_number_at(counts, "failed")};
}

// Reads counts by the names of enumerators.
template <typename Enum>
std::map<Enum, std::int64_t> tally_of(const json& object, Enum (*from_string)(std::string_view)) {
  std::map<Enum, std::int64_t> tally;
  for (const auto& [name, count] : object.items()) tally[from_string(name)] = whole_number(count);
  return tally;
}

GroupStatistics group_of(const json& object) {
  const auto mean = [&](const char* key) {
    return object.contains(key) ? std::optional(object.at(key).get<double>()) : std::nullopt;
  };
  return {counts_of(object), mean("mean_initial_error_of_kept"), mean("mean_final_error_of_kept")};
}

void read_statistics(const json& statistics, DatasetManifest& manifest) {
  manifest.reasons = tally_of(statistics.at("reasons"), manifests::reason_from_string);
  manifest.all = group_of(statistics.at("all"));
  for (const auto& [name, group] : statistics.at("by_dataset").items()) {
    manifest.by_dataset[name] = group_of(group);
  }
  for (const auto& [name, group] : statistics.at("by_family").items()) {
    manifest.by_family[manifests::family_from_string(name)] = group_of(group);
  }
  for (const auto& [name, group] : statistics.at("by_species").items()) {
    manifest.by_species[name] = group_of(group);
  }
}

// Reads the thresholds, which are null if no label is a prediction.
void read_thresholds(const json& thresholds, DatasetManifest& manifest) {
  if (thresholds.is_null()) return;
  for (const auto& [name, values] : thresholds.items()) {
    filters::Thresholds& own = manifest.thresholds[name];
    own.tau_low = values.at("tau_low").get<double>();
    own.tau_high = values.at("tau_high").get<double>();
    own.delta = values.at("delta").get<double>();
  }
}

void read_terms(const json& datasets, DatasetManifest& manifest) {
  for (const auto& [name, terms] : datasets.items()) {
    manifest.terms[name] = {terms.at("licence").get<std::string>(), terms.at("source_url").get<std::string>(),
                            terms.at("citation").get<std::string>()};
  }
}

void read_warnings(const json& warnings, DatasetManifest& manifest) {
  for (const json& each : warnings) {
    manifest.warnings.push_back({warning_kind_from_string(each.at("kind").get<std::string>()),
                                 text_of(each.at("dataset")), each.at("message").get<std::string>()});
  }
}

// Reads the config. It is stored as the user wrote it, so an absent key has its default.
void read_config(const json& config, DatasetManifest& manifest) {
  for (const json& dataset : config.at("datasets")) {
    const std::string name =
        dataset.at("name").get<std::string>() + "/" + dataset.value("split", std::string("train"));
    manifest.roles[name] =
        config::role_from_string(dataset.value("role", std::string(config::to_string(config::Role::pseudo))));
  }
  if (config.contains("shards")) {
    const json& shards = config.at("shards");
    if (shards.contains("unit_size")) {
      constexpr std::int64_t kMost = 1 << 30;
      manifest.unit_size = static_cast<std::size_t>(whole_number_at(shards, "unit_size", 1, kMost));
    }
  }
}

void read_provenance(const json& provenance, DatasetManifest& manifest) {
  read_config(provenance.at("config"), manifest);
  manifest.checkpoint_sha256 = text_of(provenance.at("checkpoint_sha256"));
  manifest.smal_asset_sha256 = text_of(provenance.at("smal_asset_sha256"));
  manifest.device = text_of(provenance.at("device"));
  const json& keys = provenance.at("stage_keys");
  manifest.keys.ingest = key_of_stage(keys, "ingest");
  manifest.keys.predict = key_of_stage(keys, "predict");
  manifest.keys.fidelity = key_of_stage(keys, "fidelity");
  manifest.keys.refine = key_of_stage(keys, "refine");
  manifest.keys.measure = key_of_stage(keys, "measure");
  if (keys.contains("crops")) manifest.keys.crops = key_of_stage(keys, "crops");  // 0.1.0 had no such stage
  manifest.keys.shards = key_of_stage(keys, "shards");
  manifest.keys.dataset = manifest.key;
}

DatasetManifest manifest_of(const json& document) {
  if (document.at("format") != kDatasetFormat) {
    throw std::runtime_error(
        fmt::format("format is {}, expected {}", document.at("format").dump(), kDatasetFormat));
  }
  DatasetManifest manifest;
  manifest.toolkit = document.value("toolkit", "?");
  const json& schema = document.at("schema");
  if (!schema.is_number_integer() || schema < 1 || schema > manifests::kShardSchema) {
    throw std::runtime_error(
        fmt::format("schema is {}, this toolkit reads 1 to {}; use the toolkit version that wrote it ({})",
                    schema.dump(), manifests::kShardSchema, manifest.toolkit));
  }
  manifest.schema = schema.get<int>();
  manifest.name = name_of("name", document.at("name").get<std::string>());
  manifest.version = document.at("version").get<std::string>();
  manifest.key = name_of("key", document.at("key").get<std::string>());
  manifest.content_id = document.at("content_id").get<std::string>();
  manifest.profile = document.at("profile").get<std::string>();
  manifest.counts = counts_of(document.at("counts"));
  manifest.labels = tally_of(document.at("labels"), manifests::label_kind_from_string);
  manifest.verdicts_sha256 = document.at("verdicts").at("sha256").get<std::string>();
  read_statistics(document.at("statistics"), manifest);
  read_thresholds(document.at("thresholds"), manifest);
  if (manifest.schema >= 2) read_terms(document.at("datasets"), manifest);
  if (document.contains("warnings")) read_warnings(document.at("warnings"), manifest);
  read_provenance(document.at("provenance"), manifest);
  for (const json& shard : document.at("shards")) {
    manifest.shards.push_back({manifests::shard_name(shard.at("file")), shard.at("sha256").get<std::string>(),
                               whole_number_at(shard, "bytes"), whole_number_at(shard, "rows"),
                               whole_number_at(shard, "unit")});
  }
  return manifest;
}

}  // namespace

fs::path dataset_folder(const fs::path& given) {
  for (const auto& folder : {given, given / "latest"}) {
    if (fs::exists(folder / "dataset.json")) return folder;
  }
  throw std::runtime_error(
      fmt::format("{}: expected a dataset folder (with dataset.json) or an output folder of "
                  "`build` (with latest/dataset.json)",
                  given.string()));
}

json read_dataset_document(const fs::path& given) {
  return manifests::read_dataset_document(dataset_folder(given) / "dataset.json");
}

DatasetManifest read_dataset_manifest(const fs::path& given) {
  const fs::path file = dataset_folder(given) / "dataset.json";
  const json document = read_dataset_document(given);
  try {
    return manifest_of(document);
  } catch (const json::exception& error) {
    throw std::runtime_error(fmt::format("{}: not a readable dataset.json: {}", file.string(), error.what()));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace q3d::pipeline::dataset
