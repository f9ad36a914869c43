// Some files state a body twice. This compares their 3D keypoints with those of the body that their pose and
// shape make.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "manifests/sample.h"
#include "pipeline/device/body_meshes.h"

namespace q3d::pipeline::candidates {

// A difference that rounding in a file does not explain.
inline constexpr double kLargestKeypointDifferenceMm = 1.0;

struct BodyCheck {
  std::size_t compared = 0;  // records with pose, shape and 3D keypoints
  std::size_t apart = 0;     // of these, by more than kLargestKeypointDifferenceMm
  double largest_mm = 0.0;
  std::string largest_id;
  std::size_t filled = 0;             // records without 3D keypoints, which now have the body's
  std::vector<std::string> findings;  // of every record, for people; empty where there is nothing to tell
};

// Poses every usable record's body without its translation and compares its 26 keypoints with the file's,
// each about its own centroid, since files differ in where their origin lies. A record without 3D keypoints
// gets the body's; with `take_body` all records do. Records without a pose or without a shape are left as
// they are.
BodyCheck check_bodies(const device::BodyMeshes& bodies, bool take_body,
                       std::vector<manifests::SampleRecord>& records);

// Returns how many of the first records make one call of the body model, since the last bits of a mesh may
// depend on the others that are posed with it: up to the one that fills the call, or 0 if these do not.
std::size_t records_of_one_call(const std::vector<manifests::SampleRecord>& records);

// Adds what was found in further records, without their findings.
void add(const BodyCheck& further, BodyCheck& check);

// One line for the run's notes.
std::string to_note(const BodyCheck& check);

}  // namespace q3d::pipeline::candidates
