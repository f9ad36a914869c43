// The sample record as JSON (what ingest stores) and its digest (what makes a unit stale).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "manifests/sample.h"

namespace q3d::manifests {

// Every member, number for number: infinities and NaN, which JSON lacks, become the strings "inf", "-inf" and
// "nan".
void to_json(nlohmann::json& json, const SampleRecord& record);
// Throws std::runtime_error naming the record's id and the member that is absent or of a wrong type
// or length.
void from_json(const nlohmann::json& json, SampleRecord& record);

// SHA-256 of everything in the record that can change a label. Absolute paths and failure_detail are left
// out, so that a moved dataset keeps its digests; the bytes of picture and mask are digested apart.
std::string record_digest(const SampleRecord& record);

}  // namespace q3d::manifests
