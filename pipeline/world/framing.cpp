#include "pipeline/world/framing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "smal/camera.h"

namespace q3d::pipeline::world {
namespace {

constexpr int kMinBoxPx = 24;

struct Extent {
  double left = std::numeric_limits<double>::infinity(), top = left;
  double right = -left, bottom = -left;
  void add(const Eigen::Vector2d& p) {
    left = std::min(left, p.x());
    right = std::max(right, p.x());
    top = std::min(top, p.y());
    bottom = std::max(bottom, p.y());
  }
  double side() const { return std::max(right - left, bottom - top); }
};

Extent projected_extent(std::span<const Eigen::Vector3f> vertices, const PictureCamera& camera,
                        const Eigen::Vector3f& translation) {
  Extent extent;
  for (const Eigen::Vector3f& vertex : vertices) extent.add(camera.project(vertex + translation));
  return extent;
}

// The factors by which a person's box differs from the silhouette's, and its offset from the centre.
struct BoxError {
  double width = 1.0, height = 1.0, shift_x = 0.0, shift_y = 0.0;
};

cv::Rect drawn_box(const Extent& seen, const BoxError& error, cv::Size picture_px) {
  const double width = (seen.right - seen.left) * error.width,
               height = (seen.bottom - seen.top) * error.height;
  const double x = 0.5 * (seen.left + seen.right) + error.shift_x * width;
  const double y = 0.5 * (seen.top + seen.bottom) + error.shift_y * height;
  const cv::Point corner(static_cast<int>(std::lround(x - 0.5 * width)),
                         static_cast<int>(std::lround(y - 0.5 * height)));
  const cv::Rect box(corner, cv::Size(std::max(kMinBoxPx, static_cast<int>(std::lround(width))),
                                      std::max(kMinBoxPx, static_cast<int>(std::lround(height)))));
  return box & cv::Rect({0, 0}, picture_px);
}

Extent clipped(Extent extent, cv::Size picture_px) {
  extent.left = std::clamp(extent.left, 0.0, picture_px.width - 1.0);
  extent.right = std::clamp(extent.right, 0.0, picture_px.width - 1.0);
  extent.top = std::clamp(extent.top, 0.0, picture_px.height - 1.0);
  extent.bottom = std::clamp(extent.bottom, 0.0, picture_px.height - 1.0);
  return extent;
}

// The intended position of the animal's bounding box, drawn before its exact proportions are known.
struct Placement {
  double side_px;
  cv::Point2d centre_px;
};

Placement draw_placement(double aspect, cv::Size picture_px, const FramingHabits& habits,
                         manifests::Rng& rng) {
  // aspect = width / height of the animal as the camera sees it
  const double shorter = std::min(picture_px.width, picture_px.height);
  double side = shorter * rng.uniform(habits.fill_low, habits.fill_high);
  // A wide animal may use a wide picture's width, and a tall one a tall picture's height.
  side *= std::clamp(aspect > 1.0 ? picture_px.width / shorter : picture_px.height / shorter, 1.0, 1.35);
  const double width = aspect > 1.0 ? side : side * aspect, height = aspect > 1.0 ? side / aspect : side;
  const auto centre = [&](double extent, double room) {
    const double slack = std::max(0.0, room - extent);
    return 0.5 * room + 0.5 * slack * std::clamp(rng.normal(0.0, 0.45), -0.95, 0.95);
  };
  Placement placement{side, {centre(width, picture_px.width), centre(height, picture_px.height)}};
  if (rng.chance(habits.truncated)) {
    placement.side_px *= rng.uniform(1.0, 1.4);
    // Move it over one border by up to a third of its own size.
    const double over = rng.uniform(0.08, 0.33) * placement.side_px;
    const double half_w = 0.5 * width * placement.side_px / side,
                 half_h = 0.5 * height * placement.side_px / side;
    switch (rng.below(5)) {
      case 0:
      case 1:
        placement.centre_px.x = half_w - over;
        break;
      case 2:
      case 3:
        placement.centre_px.x = picture_px.width - half_w + over;
        break;
      default:
        placement.centre_px.y = picture_px.height - half_h + 0.7 * std::min(over, half_h);
        break;
    }
  }
  return placement;
}

}  // namespace

PictureCamera camera_of_box(const cv::Rect& box) {
  if (box.width <= 0 || box.height <= 0) {
    throw std::invalid_argument("camera_of_box: box of " + std::to_string(box.width) + " x " +
                                std::to_string(box.height) + " px");
  }
  // As in the official code's datasets, the centre is (2 x + w) // 2 and the crop's side is the box's longer
  // one.
  return {smal::kFocalPx * std::max(box.width, box.height) / smal::kCropSidePx,
          std::floor((2.0 * box.x + box.width) / 2.0), std::floor((2.0 * box.y + box.height) / 2.0)};
}

Eigen::Vector3f fit_translation(std::span<const Eigen::Vector3f> vertices, const PictureCamera& camera,
                                const cv::Point2d& centre_px, double side_px) {
  Extent flat;  // size in SMAL units, for the first guess
  for (const Eigen::Vector3f& vertex : vertices) flat.add(vertex.head<2>().cast<double>());
  Eigen::Vector3d translation(0.0, 0.0, camera.focal_px * flat.side() / side_px);
  for (int round = 0; round < 8; ++round) {
    const Extent extent = projected_extent(vertices, camera, translation.cast<float>());
    const double scale = extent.side() / side_px;
    const double unit_px = camera.focal_px / translation.z();
    translation.x() += (centre_px.x - 0.5 * (extent.left + extent.right)) / unit_px;
    translation.y() += (centre_px.y - 0.5 * (extent.top + extent.bottom)) / unit_px;
    translation.z() *= scale;
  }
  return translation.cast<float>();
}

Framing frame_animal(std::span<const Eigen::Vector3f> vertices, cv::Size picture_px,
                     const FramingHabits& habits, manifests::Rng& rng) {
  Extent flat;
  for (const Eigen::Vector3f& vertex : vertices) flat.add(vertex.head<2>().cast<double>());
  const double aspect = (flat.right - flat.left) / (flat.bottom - flat.top);
  const Placement placement = draw_placement(aspect, picture_px, habits, rng);
  const BoxError error{rng.normal(habits.box_bias, habits.box_spread),
                       rng.normal(habits.box_bias, habits.box_spread),
                       rng.normal(0.0, 0.5 * habits.box_spread), rng.normal(0.0, 0.5 * habits.box_spread)};

  // The camera depends on the box, the silhouette on the camera, and the box on the silhouette; the
  // dependence is weak, because the animal is four or more of its own lengths away.
  Framing framing;
  const double half_w = 0.5 * placement.side_px * std::min(1.0, aspect);
  const double half_h = 0.5 * placement.side_px / std::max(1.0, aspect);
  Extent seen{placement.centre_px.x - half_w, placement.centre_px.y - half_h, placement.centre_px.x + half_w,
              placement.centre_px.y + half_h};
  for (int round = 0; round < 4; ++round) {
    framing.box = drawn_box(clipped(seen, picture_px), error, picture_px);
    framing.camera = camera_of_box(framing.box);
    framing.translation = fit_translation(vertices, framing.camera, placement.centre_px, placement.side_px);
    seen = projected_extent(vertices, framing.camera, framing.translation);
  }
  return framing;
}

}  // namespace q3d::pipeline::world
