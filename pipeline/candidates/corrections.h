// Keypoints that a person corrected: they replace those of the annotation file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/sample.h"

namespace q3d::pipeline::candidates {

struct CorrectedPoint {
  std::size_t keypoint = 0;  // index among the 26
  double x_px = 0.0;         // px of the source picture; undefined if v is 0
  double y_px = 0.0;
  int v = 0;  // 0 not labelled, 1 hidden, 2 visible
};

struct Corrections {
  std::map<std::string, std::vector<CorrectedPoint>> points;  // by sample id
  std::string sha256;                                         // of the file
  std::size_t matched = 0;                                    // ids that belong to a candidate
};

// Reads a file of corrections. Each line has one point: sample id, name of the keypoint, x, y and v,
// separated by tabs. Empty lines and lines that begin with '#' are skipped. Throws ConfigError that names
// file and line for a file that cannot be read and for a malformed line.
Corrections read_corrections(const std::filesystem::path& file);

// Returns the text of such a file.
std::string corrections_text(const std::map<std::string, std::vector<CorrectedPoint>>& points);

// Replaces the points of the records that are named. A corrected point has the weight 1, or 0 where v is 0. A
// record that failed because it had no labelled keypoint becomes usable if it has one now; a record without a
// labelled keypoint fails as no_visible_keypoints. Adds to corrections.matched.
void apply_corrections(Corrections& corrections, std::vector<manifests::SampleRecord>& records);

}  // namespace q3d::pipeline::candidates
