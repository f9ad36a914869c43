#include "pipeline/stages.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/shard.h"

namespace q3d::pipeline {
namespace {

using nlohmann::json;

// Raise a number when a change of the code changes what the stage writes.
constexpr int kIngestCode = 2;
constexpr int kPredictCode = 2;
constexpr int kFidelityCode = 1;
constexpr int kRefineCode = 1;
constexpr int kShardsCode = 1;

std::string key_of(const char* stage, int code, json parts) {
  parts["stage"] = stage;
  parts["code"] = code;
  return manifests::sha256(parts.dump());  // nlohmann sorts the keys, so the text is canonical
}

std::string ingest_key(const BuildConfig& config, const Ingest& ingest) {
  json datasets = json::array();
  for (const auto& dataset : config.datasets) {
    const std::string name = dataset.name + "/" + dataset.split;
    datasets.push_back(
        {{"name", name}, {"format", dataset.format}, {"annotations", ingest.annotation_digests.at(name)}});
  }
  json units = json::array();
  for (const Unit& unit : ingest.units) units.push_back(unit.label_digest);
  return key_of("ingest", kIngestCode, {{"datasets", datasets}, {"units", units}});
}

}  // namespace

AssetDigests digest_assets(const NetworkConfig& network, manifests::DigestCache& digests) {
  return {digests.digest(network.checkpoint), digests.digest(network.smal_asset)};
}

std::string predict_key(const BuildConfig& config, const AssetDigests& assets,
                        const std::string& device_key) {
  if (!needs_network(config)) {
    return key_of("predict", kPredictCode, {{"network", nullptr}, {"unit_size", config.shards.unit_size}});
  }
  return key_of("predict", kPredictCode,
                {{"checkpoint", assets.checkpoint},
                 {"smal_asset", assets.smal_asset},
                 {"device", device_key},
                 {"dtype", config.network.dtype},
                 {"batch", config.network.batch},
                 {"unit_size", config.shards.unit_size}});
}

StageKeys stage_keys(const BuildConfig& config, const filters::Thresholds& thresholds, const Ingest& ingest,
                     const AssetDigests& assets, const std::string& device_key) {
  StageKeys keys;
  keys.ingest = ingest_key(config, ingest);
  keys.predict = predict_key(config, assets, device_key);
  json fidelity = {{"predict", keys.predict}};
  json refine = json::object();
  if (needs_network(config)) {
    fidelity.update({{"tau_low", thresholds.tau_low},
                     {"tau_high", thresholds.tau_high},
                     {"delta", thresholds.delta},
                     {"gain_window", thresholds.gain_window}});
    refine.update({{"objective", config.tta.objective},
                   {"learning_rate", config.tta.learning_rate},
                   {"aux_weight", config.tta.aux_weight},
                   {"reproj_weight", config.tta.reproj_weight},
                   {"iterations_min", config.tta.iterations_min},
                   {"iterations_max", config.tta.iterations_max},
                   {"batch", config.tta.batch}});
  }
  keys.fidelity = key_of("fidelity", kFidelityCode, std::move(fidelity));
  refine["fidelity"] = keys.fidelity;
  keys.refine = key_of("refine", kRefineCode, std::move(refine));
  keys.shards = key_of("shards", kShardsCode,
                       {{"refine", keys.refine},
                        {"schema", manifests::kShardSchema},
                        {"name", config.name},
                        {"images", config.shards.images},
                        {"jpeg_quality", config.shards.jpeg_quality},
                        {"crop_scale", config.shards.crop_scale},
                        {"crop_min_side_px", config.shards.crop_min_side_px}});
  keys.dataset =
      key_of("dataset", 1, {{"ingest", keys.ingest}, {"shards", keys.shards}, {"version", config.version}});
  return keys;
}

std::filesystem::path stage_folder(const std::filesystem::path& out, const std::string& stage,
                                   const std::string& key) {
  return out / "stages" / (stage + "-" + key.substr(0, kShortKey));
}

void open_stage_folder(const std::filesystem::path& folder, const std::string& stage,
                       const std::string& key) {
  std::filesystem::create_directories(folder);
  manifests::remove_temporaries(folder);
  const std::filesystem::path manifest = folder / "manifest.json";
  if (std::filesystem::exists(manifest)) {
    const json found = json::parse(manifests::read_file(manifest), nullptr, false);
    if (found.is_object() && found.value("key", "") == key) return;
    throw std::runtime_error(
        fmt::format("{}: expected the {} stage with key {}, found {}; remove the folder to "
                    "make it anew",
                    manifest.string(), stage, key, found.is_object() ? found.dump() : "no JSON"));
  }
  manifests::write_file_atomically(manifest, json{{"stage", stage}, {"key", key}}.dump(2) + "\n");
}

}  // namespace q3d::pipeline
