// The stages, their keys and their folders.
//
// A stage's key is a hash of its code version, its part of the config, the keys of the stages before it and
// the digests of the assets it reads. A stage's results lie in <out>/stages/<stage>-<key>/, with one file for
// each unit and a journal. A unit's file counts only if the journal has it with the unit's current input
// digest. So a changed tau remakes the verdicts and all later stages, a changed bound of a guard remakes only
// the shards, and added photos remake only the last unit and add new ones.
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

inline constexpr std::size_t kShortKey = 12;  // number of a key's hex digits in a folder's name

// The digests are empty if the build needs no network.
struct AssetDigests {
  std::string checkpoint;
  std::string smal_asset;
  std::string priors;  // empty unless a guard needs them or guards.priors names them
};
// Throws std::runtime_error if a file is missing.
AssetDigests digest_assets(const config::BuildConfig& config, manifests::DigestCache& digests);

// Keys are 64 hex digits. device_key is pipeline::device_key(), or empty for a build that needs no network:
// its keys do not depend on network, thresholds and adaptation.
struct StageKeys {
  std::string ingest;  // annotation files and every unit's input digest
  std::string predict;
  std::string fidelity;
  std::string refine;
  std::string measure;  // the trust scores; empty if no dataset has pseudo labels
  std::string crops;    // the bytes of stored crops; independent of thresholds and network
  std::string shards;
  std::string dataset;  // the version: everything above
};

std::string predict_key(const config::BuildConfig& config, const AssetDigests& assets,
                        const std::string& device_key);
std::string crops_key(const config::ShardConfig& shards);
// Returns the keys that do not depend on the candidates, which are all but `ingest` and `dataset`. These two
// stay empty.
StageKeys keys_of_config(const config::BuildConfig& config, const config::JudgingRules& rules,
                         const AssetDigests& assets, const std::string& device_key);
StageKeys stage_keys(const config::BuildConfig& config, const config::JudgingRules& rules,
                     const candidates::Ingest& ingest, const AssetDigests& assets,
                     const std::string& device_key);

// Returns <out>/stages/<stage>-<first 12 hex digits of key>.
std::filesystem::path stage_folder(const std::filesystem::path& out, const std::string& stage,
                                   const std::string& key);
// Returns the key in a stage's manifest.json, or nothing if the file does not match its digest or holds no
// key. A manifest of an earlier version has no digest. Throws manifests::IoError.
std::optional<std::string> key_in_manifest(const std::filesystem::path& file);
// Makes the folder, removes left-over temporary files and writes manifest.json (stage and key). A
// manifest.json without a readable key is damaged. It is written anew, with a warning, if the folder has the
// name that stage_folder() gives. Throws std::runtime_error if the folder belongs to another key.
void open_stage_folder(const std::filesystem::path& folder, const std::string& stage, const std::string& key);

}  // namespace q3d::pipeline::stages
