// The sample record as JSON, which ingest stores, and its digest, which decides whether a unit is stale.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "manifests/sample.h"

namespace q3d::manifests {

// Writes every member with its exact number. Infinities and NaN, which JSON lacks, become the strings "inf",
// "-inf" and "nan".
void to_json(nlohmann::json& object, const SampleRecord& record);
// Throws std::runtime_error that names the record's id and the member that is absent or has a wrong type or
// length.
void from_json(const nlohmann::json& object, SampleRecord& record);

// Returns the SHA-256 of everything in the record that can change a label. Absolute paths and failure_detail
// are left out, so that a dataset keeps its digests when it is moved. The bytes of picture and mask, and
// the detail of a failure without this machine's paths, are digested separately.
std::string record_digest(const SampleRecord& record);

}  // namespace q3d::manifests
