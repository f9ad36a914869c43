#include "pipeline/candidates/label_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace q3d::pipeline::candidates {
namespace {

using manifests::Box;
using manifests::Keypoint;
using manifests::Reason;
using manifests::SampleRecord;

constexpr double kSlackPx = 2.0;
constexpr double kBoxSlack = 0.1;       // of the longer side; annotators draw boxes and points separately
constexpr double kSmallestBoxPx = 5.0;  // least length of the longer side
constexpr double kLargestFraction = 1.0 + 1e-6;
constexpr double kFractionReach = 1.5;  // largest distance of normalised keypoints from the middle, 0.5
constexpr double kOnePlacePx = 1.0;

bool is_visible(const Keypoint& point) {
  return point.weight > 0.0F;
}

bool is_fraction(double value) {
  return value >= 0.0 && value <= kLargestFraction;
}

// Counts the visible keypoints that lie outside a rectangle by more than `slack_px`.
int count_outside(const SampleRecord& record, const Box& rectangle, double slack_px) {
  return static_cast<int>(
      std::count_if(record.keypoints.begin(), record.keypoints.end(), [&](const Keypoint& point) {
        const double right = rectangle.x_px + rectangle.w_px;
        const double bottom = rectangle.y_px + rectangle.h_px;
        const bool is_inside = point.x_px >= rectangle.x_px - slack_px && point.x_px <= right + slack_px &&
                               point.y_px >= rectangle.y_px - slack_px && point.y_px <= bottom + slack_px;
        return is_visible(point) && !is_inside;
      }));
}

bool are_in_one_place(const SampleRecord& record) {
  const Keypoint* first = nullptr;
  for (const Keypoint& point : record.keypoints) {
    if (!is_visible(point)) continue;
    if (first == nullptr) first = &point;
    if (std::max(std::abs(point.x_px - first->x_px), std::abs(point.y_px - first->y_px)) > kOnePlacePx)
      return false;
  }
  return true;
}

std::string text(const Box& box) {
  return fmt::format("x {}, y {}, width {}, height {}", box.x_px, box.y_px, box.w_px, box.h_px);
}

}  // namespace

int keypoints_outside(const SampleRecord& record, int width_px, int height_px) {
  return count_outside(record, {0.0, 0.0, 1.0 * width_px, 1.0 * height_px}, kSlackPx);
}

std::optional<LabelProblem> find_label_problem(const SampleRecord& record, int width_px, int height_px) {
  const auto visible = std::count_if(record.keypoints.begin(), record.keypoints.end(), is_visible);
  // Points of an animal that the border cuts off lie a little outside 0 to 1.
  const bool are_fractions =
      visible > 1 && std::all_of(record.keypoints.begin(), record.keypoints.end(), [](const Keypoint& point) {
        return !is_visible(point) ||
               std::max(std::abs(point.x_px - 0.5), std::abs(point.y_px - 0.5)) <= kFractionReach;
      });
  if (are_fractions) {
    return LabelProblem{
        Reason::not_in_pixels,
        fmt::format("keypoints: all {} visible ones are between 0 and 1, or nearly so, which are normalised "
                    "coordinates; "
                    "expected pixels: multiply x by the picture's width, {}, and y by its height, {}",
                    visible, width_px, height_px)};
  }
  const Box& box = record.box;
  if (is_fraction(box.x_px) && is_fraction(box.y_px) && is_fraction(box.w_px) && is_fraction(box.h_px)) {
    return LabelProblem{
        Reason::not_in_pixels,
        fmt::format("box: got {}, which is between 0 and 1 (normalised); expected pixels of a "
                    "picture of {} x {}",
                    text(box), width_px, height_px)};
  }
  if (visible > 2 && are_in_one_place(record)) {
    return LabelProblem{
        Reason::keypoints_outside,
        fmt::format("all {} visible keypoints lie in one place, which no animal's do", visible)};
  }
  const double longer_side_px = std::max(box.w_px, box.h_px);
  if (longer_side_px < kSmallestBoxPx) {
    return LabelProblem{Reason::box_too_small, fmt::format("got {}, expected a longer side of at least {} px",
                                                           text(box), kSmallestBoxPx)};
  }
  if (const int outside = keypoints_outside(record, width_px, height_px); 2 * outside > visible) {
    return LabelProblem{Reason::keypoints_outside,
                        fmt::format("{} of {} visible keypoints lie outside the picture of {} x {} px",
                                    outside, visible, width_px, height_px)};
  }
  const int outside = count_outside(record, box, kSlackPx + kBoxSlack * longer_side_px);
  if (2 * outside <= visible) return std::nullopt;
  return LabelProblem{
      Reason::keypoints_outside,
      fmt::format("{} of {} visible keypoints lie outside the box {}", outside, visible, text(box))};
}

}  // namespace q3d::pipeline::candidates
