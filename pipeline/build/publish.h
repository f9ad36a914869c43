// From finished units to an immutable version folder.
#pragma once

#include <filesystem>
#include <vector>

#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/stages/stage_store.h"

namespace q3d::pipeline::build {

// <out>/<name>-<first 12 hex of the dataset key>.
std::filesystem::path version_folder(const std::filesystem::path& out, const config::BuildConfig& config,
                                     const stages::StageKeys& keys);

// True when the folder holds a complete dataset of this key: dataset.json, and every shard with its size.
// Throws std::runtime_error when the folder holds a dataset of another key.
bool is_published(const std::filesystem::path& folder, const stages::StageKeys& keys);

// Links the shards into `folder`, writes verdicts.csv and, last, dataset.json. Throws std::runtime_error when
// the verdicts do not add up to the candidates or a unit has no shard.
void publish(const std::filesystem::path& folder, const dataset::DatasetInputs& inputs,
             const std::vector<manifests::Judgement>& judgements, const stages::StageStore& shards);

// Makes <out>/latest a link to the version's folder, in one step.
void point_latest(const std::filesystem::path& out, const std::filesystem::path& folder);

}  // namespace q3d::pipeline::build
