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

// Replaces the points of the records that are named. A corrected point has the weight 1, or 0 where v is 0.
// A record that failed because no keypoint of it was labelled is sound again if one is now; a record without
// a labelled keypoint fails as no_visible_keypoints. Records that failed for another reason stay as they are.
//
// The records must have been compared with their pictures (picture_fit.h). A corrected record fails if its
// labels cannot be meant on its picture (label_checks.h), and as box_missing if it has no box. Adds to
// corrections.matched. Throws manifests::IoError for a picture that is there and cannot be read.
void apply_corrections(Corrections& corrections, std::vector<manifests::SampleRecord>& records);

}  // namespace q3d::pipeline::candidates
