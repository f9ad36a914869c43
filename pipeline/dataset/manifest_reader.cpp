#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "manifests/dataset_document.h"
#include "manifests/shard.h"
#include "pipeline/dataset/dataset_manifest.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

std::string text_of(const json& value) {
  return value.is_null() ? std::string() : value.get<std::string>();
}

Counts counts_of(const json& counts) {
  return {counts.at("candidates").get<std::int64_t>(), counts.at("retained").get<std::int64_t>(),
          counts.at("refined").get<std::int64_t>(), counts.at("discarded").get<std::int64_t>(),
          counts.at("failed").get<std::int64_t>()};
}

// Counts by the names of enumerators.
template <typename Enum>
std::map<Enum, std::int64_t> tally_of(const json& object, Enum (*from_string)(std::string_view)) {
  std::map<Enum, std::int64_t> tally;
  for (const auto& [name, count] : object.items())
    tally[from_string(name)] = count.template get<std::int64_t>();
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

// Null where no label is a prediction.
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

// The config stands there as the user wrote it: what is absent has its default.
void read_config(const json& config, DatasetManifest& manifest) {
  for (const json& dataset : config.at("datasets")) {
    const std::string name =
        dataset.at("name").get<std::string>() + "/" + dataset.value("split", std::string("train"));
    manifest.roles[name] =
        config::role_from_string(dataset.value("role", std::string(config::to_string(config::Role::pseudo))));
  }
  if (config.contains("shards")) {
    manifest.unit_size = config.at("shards").value("unit_size", manifest.unit_size);
  }
  if (manifest.unit_size == 0) throw std::runtime_error("provenance.config.shards.unit_size is 0");
}

void read_provenance(const json& provenance, DatasetManifest& manifest) {
  read_config(provenance.at("config"), manifest);
  manifest.checkpoint_sha256 = text_of(provenance.at("checkpoint_sha256"));
  manifest.smal_asset_sha256 = text_of(provenance.at("smal_asset_sha256"));
  manifest.device = text_of(provenance.at("device"));
  const json& keys = provenance.at("stage_keys");
  manifest.keys.ingest = text_of(keys.at("ingest"));
  manifest.keys.predict = text_of(keys.at("predict"));
  manifest.keys.fidelity = text_of(keys.at("fidelity"));
  manifest.keys.refine = text_of(keys.at("refine"));
  manifest.keys.measure = text_of(keys.at("measure"));
  if (keys.contains("crops")) manifest.keys.crops = text_of(keys.at("crops"));  // 0.1.0 had no such stage
  manifest.keys.shards = text_of(keys.at("shards"));
  manifest.keys.dataset = manifest.key;
}

DatasetManifest manifest_of(const json& document) {
  if (document.at("format") != kDatasetFormat) {
    throw std::runtime_error(
        fmt::format("format is {}, expected {}", document.at("format").dump(), kDatasetFormat));
  }
  DatasetManifest manifest;
  manifest.toolkit = document.value("toolkit", "?");
  manifest.schema = document.at("schema").get<int>();
  if (manifest.schema < 1 || manifest.schema > manifests::kShardSchema) {
    throw std::runtime_error(
        fmt::format("schema is {}, this toolkit reads 1 to {}; use the toolkit version that wrote it ({})",
                    manifest.schema, manifests::kShardSchema, manifest.toolkit));
  }
  manifest.name = document.at("name").get<std::string>();
  manifest.version = document.at("version").get<std::string>();
  manifest.key = document.at("key").get<std::string>();
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
                               shard.at("bytes").get<std::int64_t>(), shard.at("rows").get<std::int64_t>(),
                               shard.at("unit").get<std::int64_t>()});
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
