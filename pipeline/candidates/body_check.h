// Some files state a body twice, as pose and shape and as 3D keypoints. This check compares the two.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "manifests/sample.h"
#include "pipeline/device/body_meshes.h"

namespace q3d::pipeline::candidates {

// Rounding in a file does not explain a larger difference.
inline constexpr double kLargestKeypointDifferenceMm = 1.0;

struct BodyCheck {
  std::size_t compared = 0;  // records with pose, shape and 3D keypoints
  std::size_t apart = 0;     // of these, records that differ by more than kLargestKeypointDifferenceMm
  double largest_mm = 0.0;
  std::string largest_id;
  std::size_t filled = 0;             // records without 3D keypoints, which now have the body's
  std::vector<std::string> findings;  // one for each record, for people; empty if there is nothing to report
};

// Poses every usable record's body without its translation and compares its 26 keypoints with the file's,
// each about its own centroid, since files differ in where their origin lies. A record without 3D keypoints
// gets the body's; with `take_body` all records do. Records without a pose or without a shape are left as
// they are.
BodyCheck check_bodies(const device::BodyMeshes& bodies, bool take_body,
                       std::vector<manifests::SampleRecord>& records);

// Few of a dataset's records may have a body; so many records wait for a call at most.
inline constexpr std::size_t kMostRecordsOfOneCall = 4096;

// Returns how many of the first records fill one call of the body model: those up to its last mesh, or
// kMostRecordsOfOneCall if they hold too few bodies. Returns 0 if there are too few records. Where a call
// ends depends on the records alone, because the last bits of a mesh may depend on the meshes that are posed
// with it.
std::size_t records_of_one_call(const std::vector<manifests::SampleRecord>& records);

// Adds the counts of further records, but not their findings.
void add(const BodyCheck& further, BodyCheck& check);

// Returns one line for the run's notes.
std::string to_note(const BodyCheck& check);

}  // namespace q3d::pipeline::candidates
