#include "loaders/pictures/box.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace q3d::loaders::pictures {
namespace {

using manifests::Box;
using manifests::Reason;
using manifests::SampleRecord;

// Keypoints may lie this far outside their box: Animal Kingdom's boxes are half a pixel short on each side.
constexpr double kSlackPx = 2.0;

double limit(int size_px) {
  return size_px > 0 ? size_px + kSlackPx : std::numeric_limits<double>::infinity();
}

bool holds_keypoints(const Box& box, const manifests::Keypoints& keypoints) {
  return std::all_of(keypoints.begin(), keypoints.end(), [&](const manifests::Keypoint& point) {
    return point.weight == 0.0F ||
           (point.x_px >= box.x_px - kSlackPx && point.x_px <= box.x_px + box.w_px + kSlackPx &&
            point.y_px >= box.y_px - kSlackPx && point.y_px <= box.y_px + box.h_px + kSlackPx);
  });
}

bool fits_image(const Box& box, const SampleRecord& record) {
  return box.x_px + box.w_px <= limit(record.width_px) && box.y_px + box.h_px <= limit(record.height_px);
}

}  // namespace

std::optional<BoxProblem> find_box_problem(const Box& box, int width_px, int height_px) {
  const std::string got =
      fmt::format("x {}, y {}, width {}, height {}", box.x_px, box.y_px, box.w_px, box.h_px);
  if (!(box.w_px > 0.0 && box.h_px > 0.0)) {
    return BoxProblem{Reason::box_zero_size, got, "width and height above 0"};
  }
  const bool outside = box.x_px + box.w_px <= 0.0 || box.y_px + box.h_px <= 0.0 ||
                       (width_px > 0 && box.x_px >= width_px) || (height_px > 0 && box.y_px >= height_px);
  if (!outside) return std::nullopt;
  return BoxProblem{Reason::box_outside_image, got,
                    fmt::format("a box that meets the image of {} x {} px", width_px, height_px)};
}

BoxVote vote_on_boxes(std::span<const SampleRecord> records) {
  BoxVote vote;
  for (const SampleRecord& record : records) {
    if (record.failure != Reason::none || std::isnan(record.box.x_px)) continue;
    const Box corners = box_from_corners(record.box);
    const bool in_order = corners.w_px > 0.0 && corners.h_px > 0.0;
    const bool corners_fit =
        in_order && fits_image(corners, record) && holds_keypoints(corners, record.keypoints);
    const bool extents_fit = fits_image(record.box, record) && holds_keypoints(record.box, record.keypoints);
    if (corners_fit && !extents_fit) ++vote.corners;
    if (!in_order || (extents_fit && !corners_fit)) ++vote.extents;
  }
  return vote;
}

std::optional<Box> box_around(std::span<const manifests::Keypoint> keypoints, double margin) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double left = kInfinity;
  double top = kInfinity;
  double right = -kInfinity;
  double bottom = -kInfinity;
  for (const manifests::Keypoint& point : keypoints) {
    if (!(point.weight > 0.0F)) continue;
    left = std::min(left, point.x_px);
    right = std::max(right, point.x_px);
    top = std::min(top, point.y_px);
    bottom = std::max(bottom, point.y_px);
  }
  if (left > right) return std::nullopt;
  const double added_px = margin * std::max(right - left, bottom - top);
  return Box{left - added_px, top - added_px, right - left + 2 * added_px, bottom - top + 2 * added_px};
}

Box box_from_corners(const Box& corners) {
  return {corners.x_px, corners.y_px, corners.w_px - corners.x_px, corners.h_px - corners.y_px};
}

}  // namespace q3d::loaders::pictures
