// Makes an immutable version folder from finished units.
#pragma once

#include <filesystem>

#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/dataset/judgement_list.h"
#include "pipeline/stages/stage_store.h"

namespace q3d::pipeline::build {

// Returns <out>/<name>-<first 12 hex digits of the dataset key>.
std::filesystem::path version_folder(const std::filesystem::path& out, const config::BuildConfig& config,
                                     const stages::StageKeys& keys);

// Links the shards into `folder`, where each replaces an older file of its name, writes verdicts.csv and,
// last, dataset.json. When it returns, all of it has reached the disk. Throws std::runtime_error when the
// verdicts do not add up to the candidates or a unit has no shard.
void publish(const std::filesystem::path& folder, const dataset::DatasetInputs& inputs,
             const dataset::JudgementList& judgements, stages::StageStore& shards);

// Makes <out>/latest a link to the version's folder, in one step and durably.
void point_latest(const std::filesystem::path& out, const std::filesystem::path& folder);

}  // namespace q3d::pipeline::build
