// Finds out which of two conventions the boxes of an annotation file follow, and which boxes cannot be used.
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

// Returns a problem if the box has no area or lies completely outside an image of the given size (0: the size
// is unknown and not checked).
std::optional<BoxProblem> find_box_problem(const manifests::Box& box, int width_px, int height_px);

// COCO writes x, y, width, height. Pseudo-labels of DeepLabCut's video adaptation, AnimalPose and AwA-Pose
// write x1, y1, x2, y2 under the same name. A reading fits a record if the box ends inside the image and
// contains all labelled keypoints; often both readings fit. A record whose box fits only as corners is a vote
// for corners. A record whose box fits only as x, y, width, height, or whose corners are out of order, is a
// vote against corners. All boxes of a file are written in the same way, so the majority of the votes
// decides; a tie means x, y, width, height.
struct BoxVote {
  std::size_t corners = 0;  // records that fit only as x1, y1, x2, y2
  std::size_t extents = 0;  // records that fit only as x, y, width, height
  bool is_corners() const { return corners > extents; }
};

// Counts the votes of records whose box holds the four numbers as the file has them. Failed records and
// records without a box (NaN) have no vote.
BoxVote vote_on_boxes(std::span<const manifests::SampleRecord> records);

// Returns a box around the keypoints of weight > 0, enlarged on each side by `margin` times its longer side,
// or nothing if there are no such keypoints.
std::optional<manifests::Box> box_around(std::span<const manifests::Keypoint> keypoints, double margin);

// Converts corners (x1, y1, x2, y2) that are stored as a box to x, y, width, height.
manifests::Box box_from_corners(const manifests::Box& corners);

}  // namespace q3d::loaders::pictures
