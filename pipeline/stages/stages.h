// The stages, their keys and their folders.
//
// A stage's key is a hash of its code version, its part of the config, the keys of the stages before it and
// the digests of the assets it reads. What a stage made lies in <out>/stages/<stage>-<key>/, one file a unit
// and a journal; a unit's file counts only if the journal holds it with the unit's own input digest. So a
// changed tau redoes the verdicts and what follows, a changed bound of a guard the shards alone, and added
// photos make only new units and the last one.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <optional>
#include <string>

#include "manifests/digest.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"
#include "pipeline/config/judging_rules.h"

namespace q3d::pipeline::stages {

inline constexpr std::size_t kShortKey = 12;  // hex digits of a key that appear in a folder's name

// Empty when the build needs no network.
struct AssetDigests {
  std::string checkpoint;
  std::string smal_asset;
  std::string priors;  // empty unless a guard needs them or guards.priors names them
};
// Throws std::runtime_error when a file is missing.
AssetDigests digest_assets(const config::BuildConfig& config, manifests::DigestCache& digests);

// Keys are 64 hex digits. device_key is pipeline::device_key(), or empty for a build
// that needs no network: its keys hold nothing of network, thresholds and adaptation.
struct StageKeys {
  std::string ingest;  // annotation files and every unit's input digest
  std::string predict;
  std::string fidelity;
  std::string refine;
  std::string measure;  // the trust scores; empty when no dataset has pseudo labels
  std::string crops;    // the bytes of stored crops; thresholds and network have no part in it
  std::string shards;
  std::string dataset;  // the version: everything above
};

std::string predict_key(const config::BuildConfig& config, const AssetDigests& assets,
                        const std::string& device_key);
std::string crops_key(const config::ShardConfig& shards);
// The keys that do not depend on the candidates: all but `ingest` and `dataset`, which stay empty.
StageKeys keys_of_config(const config::BuildConfig& config, const config::JudgingRules& rules,
                         const AssetDigests& assets, const std::string& device_key);
StageKeys stage_keys(const config::BuildConfig& config, const config::JudgingRules& rules,
                     const candidates::Ingest& ingest, const AssetDigests& assets,
                     const std::string& device_key);

// <out>/stages/<stage>-<first 12 of key>.
std::filesystem::path stage_folder(const std::filesystem::path& out, const std::string& stage,
                                   const std::string& key);
// The key that a stage's manifest.json holds; nothing when it differs from the digest at its end, or holds
// none. A manifest of an earlier version has no digest. Throws manifests::IoError.
std::optional<std::string> key_in_manifest(const std::filesystem::path& file);
// Makes the folder, removes torn temporaries and writes manifest.json (stage and key). A manifest.json
// without a readable key is damaged: it is written anew if the folder has the name that stage_folder gives,
// and a warning says so. Throws std::runtime_error when the folder belongs to another key.
void open_stage_folder(const std::filesystem::path& folder, const std::string& stage, const std::string& key);

}  // namespace q3d::pipeline::stages
