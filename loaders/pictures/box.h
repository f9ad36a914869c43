// Boxes of annotation files: which of the two ways of writing them a file uses, and what makes one unusable.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "manifests/sample.h"

namespace q3d::loaders::pictures {

struct BoxProblem {
  manifests::Reason reason;
  std::string got;
  std::string expected;
};

// No area, or wholly outside an image of the given size (0: unknown, not checked).
std::optional<BoxProblem> find_box_problem(const manifests::Box& box, int width_px, int height_px);

// COCO writes x, y, width, height. Pseudo-labels of DeepLabCut's video adaptation, AnimalPose and AwA-Pose
// write x1, y1, x2, y2 under the same name. A reading fits a record when the box ends inside the image and
// holds all labelled keypoints; often both readings do. A record whose box fits as corners alone speaks for
// corners; one whose box does not, or whose corners are out of order, speaks against. A file is written one
// way, so the majority of the records that speak decides; a tie is x, y, width, height.
struct BoxVote {
  std::size_t corners = 0;  // records that fit as x1, y1, x2, y2 alone
  std::size_t extents = 0;  // records that fit as x, y, width, height alone
  bool is_corners() const { return corners > extents; }
};

// Records whose box holds the four numbers as they stand in the file. Failed records, and those without a box
// (NaN), have no say.
BoxVote vote_on_boxes(std::span<const manifests::SampleRecord> records);

// Around the keypoints of weight > 0, wider by `margin` times its longer side on each side. Nothing when
// there are none.
std::optional<manifests::Box> box_around(std::span<const manifests::Keypoint> keypoints, double margin);

// (x1, y1, x2, y2) held as a box -> the box.
manifests::Box box_from_corners(const manifests::Box& corners);

}  // namespace q3d::loaders::pictures
