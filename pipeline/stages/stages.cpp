#include "pipeline/stages/stages.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "filters/trust.h"
#include "manifests/atomic_file.h"
#include "manifests/sealed_json.h"
#include "manifests/shard.h"
#include "pipeline/config/build_settings.h"
#include "pipeline/run/log.h"
#include "pipeline/stages/made_from.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::stages {
namespace {

using nlohmann::json;

// Raise a stage's number when a change of the code changes its output.
constexpr int kIngestCode = 3;
constexpr int kPredictCode = 5;
constexpr int kFidelityCode = 2;
constexpr int kRefineCode = 3;
constexpr int kMeasureCode = 2;
constexpr int kCropsCode = 1;
constexpr int kShardsCode = 2;

// Returns the text whose SHA-256 is the stage's key. nlohmann::json sorts the keys, so the text is canonical.
std::string key_text(const char* stage, int code, json parts) {
  parts["stage"] = stage;
  parts["code"] = code;
  return parts.dump();
}

std::string ingest_text(const config::BuildConfig& config, const candidates::Ingest& ingest) {
  json datasets = json::array();
  for (const auto& dataset : config.datasets) {
    const std::string name = dataset.name + "/" + dataset.split;
    datasets.push_back(
        {{"name", name}, {"format", dataset.format}, {"annotations", ingest.annotation_digests.at(name)}});
  }
  json units = json::array();
  for (const candidates::Unit& unit : ingest.units) units.push_back(unit.label_digest);
  return key_text("ingest", kIngestCode, {{"datasets", datasets}, {"units", units}});
}

bool are_equal(const filters::Thresholds& a, const filters::Thresholds& b) {
  return a.tau_low == b.tau_low && a.tau_high == b.tau_high && a.delta == b.delta &&
         a.gain_window == b.gain_window;
}

json thresholds_json(const filters::Thresholds& thresholds) {
  return {{"tau_low", thresholds.tau_low},
          {"tau_high", thresholds.tau_high},
          {"delta", thresholds.delta},
          {"gain_window", thresholds.gain_window}};
}

// Returns the thresholds in one form, whether they were given for all datasets or for each of them.
json fidelity_parts(const config::JudgingRules& rules) {
  const filters::Thresholds& first = rules.thresholds.begin()->second;
  const bool are_common = std::all_of(rules.thresholds.begin(), rules.thresholds.end(),
                                      [&](const auto& each) { return are_equal(each.second, first); });
  if (are_common) return thresholds_json(first);
  json datasets = json::object();
  for (const auto& [name, thresholds] : rules.thresholds) datasets[name] = thresholds_json(thresholds);
  return {{"datasets", datasets}};
}

json refine_parts(const config::TtaConfig& tta, const config::GuardConfig& guards) {
  json parts = config::key_parts(config::tta_settings(), tta, config::DecidedStage::refine);
  if (guards.iterations_full_at > 0) parts["iterations_full_at"] = guards.iterations_full_at;
  if (guards.held_out_share > 0.0) {
    parts["held_out"] = {{"share", guards.held_out_share},
                         {"seed", guards.held_out_seed},
                         {"patience", guards.held_out_patience}};
  }
  return parts;
}

json bounds_json(const filters::GuardBounds& bounds) {
  return {{"visible_min", bounds.visible_min},
          {"pose_deviation_max", bounds.pose_deviation_max},
          {"limb_factor_max", bounds.limb_factor_max},
          {"left_right_max", bounds.left_right_max},
          {"mask_iou_min", bounds.mask_iou_min}};
}

std::string folder_name(const std::string& stage, const std::string& key) {
  return stage + "-" + key.substr(0, kShortKey);
}

std::string predict_text(const config::BuildConfig& config, const AssetDigests& assets,
                         const std::string& device_key) {
  if (!config::needs_network(config)) {
    return key_text("predict", kPredictCode, {{"network", nullptr}, {"unit_size", config.shards.unit_size}});
  }
  json parts = config::key_parts(config::network_settings(), config.network, config::DecidedStage::predict);
  parts.update(config::key_parts(config::shard_settings(), config.shards, config::DecidedStage::predict));
  parts.update(
      {{"checkpoint", assets.checkpoint}, {"smal_asset", assets.smal_asset}, {"device", device_key}});
  return key_text("predict", kPredictCode, std::move(parts));
}

std::string crops_text(const config::ShardConfig& shards) {
  json parts = {{"images", manifests::to_string(shards.images)},
                {"crop_scale", shards.crop_scale},
                {"crop_min_side_px", shards.crop_min_side_px},
                {"unit_size", shards.unit_size}};
  if (shards.images == manifests::ImageEncoding::jpeg) parts["jpeg_quality"] = shards.jpeg_quality;
  return key_text("crops", kCropsCode, std::move(parts));
}

// The keys, and the texts of which they are digests, by the stages' names.
struct Recipes {
  StageKeys keys;
  std::map<std::string, std::string> texts;

  const std::string& set(Stage stage, std::string text) {
    std::string& key = key_of(keys, stage);
    key = manifests::sha256(text);
    texts[std::string(to_string(stage))] = std::move(text);
    return key;
  }
};

Recipes recipes_of_config(const config::BuildConfig& config, const config::JudgingRules& rules,
                          const AssetDigests& assets, const std::string& device_key) {
  Recipes recipes;
  const std::string& predict = recipes.set(Stage::predict, predict_text(config, assets, device_key));
  const bool judges = config::needs_network(config);
  json fidelity = judges ? fidelity_parts(rules) : json::object();
  fidelity["predict"] = predict;
  json refine = judges ? refine_parts(config.tta, config.guards) : json::object();
  refine["fidelity"] = recipes.set(Stage::fidelity, key_text("fidelity", kFidelityCode, std::move(fidelity)));
  if (config::uses_priors(config.tta)) refine["priors"] = assets.priors;
  const std::string& refined = recipes.set(Stage::refine, key_text("refine", kRefineCode, std::move(refine)));
  json shards = config::key_parts(config::shard_settings(), config.shards, config::DecidedStage::shards);
  shards.update({{"refine", refined}, {"schema", manifests::kShardSchema}, {"name", config.name}});
  if (judges) {
    shards["measure"] = recipes.set(
        Stage::measure, key_text("measure", kMeasureCode, {{"refine", refined}, {"priors", assets.priors}}));
    shards["bounds"] = bounds_json(config.guards);
    shards["trust"] = {{"version", filters::kTrustVersion}, {"least", rules.min_trust}};
  }
  recipes.set(Stage::crops, crops_text(config.shards));
  recipes.set(Stage::shards, key_text("shards", kShardsCode, std::move(shards)));
  return recipes;
}

Recipes recipes_of_build(const config::BuildConfig& config, const config::JudgingRules& rules,
                         const candidates::Ingest& ingest, const AssetDigests& assets,
                         const std::string& device_key) {
  Recipes recipes = recipes_of_config(config, rules, assets, device_key);
  recipes.set(Stage::ingest, ingest_text(config, ingest));
  return recipes;
}

}  // namespace

AssetDigests digest_assets(const config::BuildConfig& config, manifests::DigestCache& digests) {
  if (!config::needs_network(config)) return {};
  AssetDigests assets{
      digests.digest(config.network.checkpoint), digests.digest(config.network.smal_asset), {}};
  if (config::uses_priors(config.guards) || config::uses_priors(config.tta) ||
      !config.guards.priors.empty()) {
    assets.priors = digests.digest(config::priors_file(config));
  }
  return assets;
}

std::string predict_key(const config::BuildConfig& config, const AssetDigests& assets,
                        const std::string& device_key) {
  return manifests::sha256(predict_text(config, assets, device_key));
}

std::string crops_key(const config::ShardConfig& shards) {
  return manifests::sha256(crops_text(shards));
}

StageKeys keys_of_config(const config::BuildConfig& config, const config::JudgingRules& rules,
                         const AssetDigests& assets, const std::string& device_key) {
  return recipes_of_config(config, rules, assets, device_key).keys;
}

StageKeys stage_keys(const config::BuildConfig& config, const config::JudgingRules& rules,
                     const candidates::Ingest& ingest, const AssetDigests& assets,
                     const std::string& device_key) {
  StageKeys keys = recipes_of_build(config, rules, ingest, assets, device_key).keys;
  keys.dataset = manifests::sha256(key_text(
      "dataset", 1, {{"ingest", keys.ingest}, {"shards", keys.shards}, {"version", config.version}}));
  return keys;
}

std::map<std::string, std::string> made_from(const config::BuildConfig& config,
                                             const config::JudgingRules& rules,
                                             const candidates::Ingest& ingest, const AssetDigests& assets,
                                             const std::string& device_key) {
  return recipes_of_build(config, rules, ingest, assets, device_key).texts;
}

std::optional<std::string> key_in_manifest(const std::filesystem::path& file) {
  try {
    const auto [manifest, has_digest] = manifests::read_sealed_json(file);
    // A manifest of an earlier version has no digest and only these two members. One with more members and no
    // digest is damaged.
    constexpr std::size_t kMembers = 2;
    if (!has_digest && manifest.size() != kMembers) return std::nullopt;
    const auto found = manifest.find("key");
    if (found == manifest.end() || !found->is_string()) return std::nullopt;
    std::string key = found->get<std::string>();
    const bool is_key = key.size() == 64 && key.find_first_not_of("0123456789abcdef") == std::string::npos;
    return is_key ? std::optional(std::move(key)) : std::nullopt;
  } catch (const manifests::DamagedDocument&) {
    return std::nullopt;
  }
}

std::filesystem::path stage_folder(const std::filesystem::path& out, const std::string& stage,
                                   const std::string& key) {
  return out / "stages" / folder_name(stage, key);
}

void open_stage_folder(const std::filesystem::path& folder, const std::string& stage,
                       const std::string& key) {
  std::filesystem::create_directories(folder);
  manifests::remove_temporaries(folder);
  const std::filesystem::path manifest = folder / "manifest.json";
  if (std::filesystem::exists(manifest)) {
    const std::optional<std::string> found = key_in_manifest(manifest);
    if (found == key) return;
    if (found || folder.filename() != folder_name(stage, key)) {
      throw std::runtime_error(
          fmt::format("{}: expected the {} stage with key {}, found {}; remove the folder to make it anew",
                      manifest.string(), stage, key, found ? "key " + *found : "no readable key"));
    }
    run::log_warning(fmt::format("{}: damaged: got no readable key, expected {}; it is written anew",
                                 manifest.string(), key));
  }
  manifests::write_file_atomically(manifest, manifests::seal_json({{"stage", stage}, {"key", key}}));
  // Make the names of the new folders durable, up to the folder that the user gave.
  manifests::sync_folder(folder.parent_path());
  manifests::sync_folder(folder.parent_path().parent_path());
}

}  // namespace q3d::pipeline::stages
