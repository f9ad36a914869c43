// `diff`: shows what changed between two versions, candidate by candidate.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "manifests/verdict.h"

namespace q3d::pipeline::derived {

// The change of a label whose candidate both versions keep.
struct LabelChange {
  std::string id;
  double error_before = 0.0;  // L_proj in crop units; NaN where it was not computed
  double error_after = 0.0;
  double rotation_deg = 0.0;     // mean angle between the joints' rotations
  double betas = 0.0;            // Euclidean distance
  double keypoints_3d_mm = 0.0;  // mean distance before the translation is added; a SMAL unit is a metre
  double translation_mm = 0.0;
};

struct VersionDifference {
  std::string before;  // name of the version
  std::string after;
  std::int64_t in_both = 0;
  std::vector<std::string> only_before;  // ids of candidates
  std::vector<std::string> only_after;
  // The candidates of both versions whose verdict differs, by (before, after).
  std::map<std::pair<manifests::Verdict, manifests::Verdict>, std::vector<std::string>> verdicts;
  std::int64_t equal_labels = 0;    // candidates that both keep, with all numbers of the label equal
  std::vector<LabelChange> labels;  // kept in both and changed, the largest change of keypoints first
};

// Throws std::runtime_error for versions that cannot be read, and Interrupted.
VersionDifference compare_versions(const std::filesystem::path& before, const std::filesystem::path& after);

// These return the whole difference, and a page for people.
nlohmann::ordered_json to_json(const VersionDifference& difference);
std::string page_of(const VersionDifference& difference);

}  // namespace q3d::pipeline::derived
