// Returns the inputs of each stage of a build, as the texts whose digests are the stages' keys.
#pragma once

#include <map>
#include <string>

#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {

// Returns, by the stages' names, the canonical JSON texts whose SHA-256 are the keys that stage_keys() gives.
// `measure` is absent where it has no key.
std::map<std::string, std::string> made_from(const config::BuildConfig& config,
                                             const config::JudgingRules& rules,
                                             const candidates::Ingest& ingest, const AssetDigests& assets,
                                             const std::string& device_key);

}  // namespace q3d::pipeline::stages
