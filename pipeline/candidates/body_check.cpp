#include "pipeline/candidates/body_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "smal/axis_angle.h"

namespace q3d::pipeline::candidates {
namespace {

using smal::Keypoints3d;

constexpr double kMmPerUnit = 1000.0;

std::array<double, 3> centroid(const Keypoints3d& keypoints) {
  std::array<double, 3> sum{};
  for (std::size_t i = 0; i < keypoints.size(); ++i) sum[i % 3] += keypoints[i];
  for (double& axis : sum) axis /= manifests::kNumKeypoints;
  return sum;
}

struct Difference {
  double mm = 0.0;
  std::size_t keypoint = 0;
};

// Returns the difference of the keypoint that lies furthest off.
Difference largest_difference(const Keypoints3d& file, const Keypoints3d& body) {
  const std::array<double, 3> file_centre = centroid(file);
  const std::array<double, 3> body_centre = centroid(body);
  Difference largest;
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    double squared = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double off = (file[3 * k + axis] - file_centre[axis]) - (body[3 * k + axis] - body_centre[axis]);
      squared += off * off;
    }
    const double mm = kMmPerUnit * std::sqrt(squared);
    if (mm > largest.mm) largest = {mm, k};
  }
  return largest;
}

void check_one(const Keypoints3d& body, bool take_body, manifests::SampleRecord& record, std::string& finding,
               BodyCheck& check) {
  manifests::BodyTruth& truth = *record.truth;
  if (!truth.has_keypoints_3d) {
    truth.keypoints_3d = body;
    truth.has_keypoints_3d = true;
    finding = "keypoint_3d is not in the file and was computed from its body";
    ++check.filled;
    return;
  }
  const Difference difference = largest_difference(truth.keypoints_3d, body);
  ++check.compared;
  if (difference.mm > check.largest_mm) {
    check.largest_mm = difference.mm;
    check.largest_id = record.id;
  }
  if (difference.mm > kLargestKeypointDifferenceMm) {
    ++check.apart;
    finding = fmt::format("keypoint_3d: keypoint {} lies {:.1f} mm from that of the file's own body{}",
                          difference.keypoint, difference.mm, take_body ? ", which was taken" : "");
  }
  if (take_body) truth.keypoints_3d = body;
}

constexpr std::size_t kMeshesAtOnce = 256;  // 3,889 vertices each: some 12 MB

bool is_compared(const manifests::SampleRecord& record) {
  return record.failure == manifests::Reason::none && record.truth && record.truth->has_pose &&
         record.truth->has_betas;
}

}  // namespace

std::size_t records_of_one_call(const std::vector<manifests::SampleRecord>& records) {
  std::size_t compared = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    compared += is_compared(records[i]) ? 1 : 0;
    if (compared == kMeshesAtOnce || i + 1 == kMostRecordsOfOneCall) return i + 1;
  }
  return 0;
}

void add(const BodyCheck& further, BodyCheck& check) {
  check.compared += further.compared;
  check.apart += further.apart;
  check.filled += further.filled;
  if (further.largest_mm > check.largest_mm) {
    check.largest_mm = further.largest_mm;
    check.largest_id = further.largest_id;
  }
}

BodyCheck check_bodies(const device::BodyMeshes& bodies, bool take_body,
                       std::vector<manifests::SampleRecord>& records) {
  BodyCheck check;
  check.findings.resize(records.size());
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (is_compared(records[i])) chosen.push_back(i);
  }
  for (std::size_t first = 0; first < chosen.size(); first += kMeshesAtOnce) {
    const auto part = std::span(chosen).subspan(first, std::min(kMeshesAtOnce, chosen.size() - first));
    std::vector<smal::Body> posed;
    for (const std::size_t i : part) {
      const manifests::BodyTruth& truth = *records[i].truth;
      posed.push_back({.pose = smal::rotation_matrices(truth.pose_axis_angle), .betas = truth.betas});
    }
    const std::vector<device::BodyMesh> meshes = bodies.pose(posed);
    for (std::size_t j = 0; j < part.size(); ++j) {
      check_one(meshes[j].keypoints_3d, take_body, records[part[j]], check.findings[part[j]], check);
    }
  }
  return check;
}

std::string to_note(const BodyCheck& check) {
  std::string text =
      fmt::format("keypoint_3d against the bodies of pose and shape: {} of {} agree within {:.0f} mm",
                  check.compared - check.apart, check.compared, kLargestKeypointDifferenceMm);
  if (check.apart > 0)
    text += fmt::format("; the largest difference is {:.1f} mm, {}", check.largest_mm, check.largest_id);
  if (check.filled > 0) text += fmt::format("; {} records had none and have the body's", check.filled);
  return text;
}

}  // namespace q3d::pipeline::candidates
