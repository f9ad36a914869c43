// `explain`: reports everything about one candidate, from its picture to its verdict.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>

namespace q3d::pipeline::dataset {

// Reads the candidate's row of verdicts.csv. If the stages' folders still lie beside the dataset, it reads
// the input and result of predict and the course of refine. Without them, it reads the shard of a kept
// sample. The keys are:
//   id, dataset, verdict {verdict, reason, detail, initial_error, final_error, gain, iterations,
//   best_iteration}, why (a sentence), thresholds, source {...}, crop {...}, keypoints [{name, v, weight,
//   annotated_px, error_before, error_after}], curve [L_proj of iterates 0..n], label {shard, row, kind,
//   meaning}, missing (what could not be found)
// Errors are in crop units (crop side = 1). Throws std::runtime_error when the folder holds no dataset or the
// id is none of its candidates'; then it names the nearest.
nlohmann::ordered_json explain(const std::filesystem::path& given, const std::string& id);

// Returns the same report in words, for a terminal.
std::string tell(const nlohmann::ordered_json& story);

}  // namespace q3d::pipeline::dataset
