// Finds labels that are surely wrong: fractions instead of pixels, points outside their picture, boxes of a
// few pixels.
#pragma once

#include <optional>
#include <string>

#include "manifests/sample.h"

namespace q3d::pipeline::candidates {

struct LabelProblem {
  manifests::Reason reason = manifests::Reason::none;
  std::string detail;  // what was found and expected
};

// Checks the visible keypoints and the box of a record against the size of its picture. Returns nothing if
// they are plausible; single keypoints may lie outside the picture or the box.
std::optional<LabelProblem> find_label_problem(const manifests::SampleRecord& record, int width_px,
                                               int height_px);

// Returns how many visible keypoints lie outside the picture by more than two pixels.
int keypoints_outside(const manifests::SampleRecord& record, int width_px, int height_px);

}  // namespace q3d::pipeline::candidates
