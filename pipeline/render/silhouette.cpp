#include "pipeline/render/silhouette.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "loaders/pictures/crop.h"
#include "smal/camera.h"

namespace q3d::pipeline::render {
namespace {

constexpr double kNearestDepth = 1e-3;  // SMAL units

struct Point {
  double x, y;
};

// Returns twice the signed area of the triangle a, b, c.
double cross(Point a, Point b, Point c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

bool is_finite(Point p) {
  return std::isfinite(p.x) && std::isfinite(p.y);
}

// Returns the first and the last pixel centre in [low, high] of an image of `side` pixels.
std::array<int, 2> pixels_between(double low, double high, int side) {
  const auto beyond = static_cast<double>(side);
  return {static_cast<int>(std::ceil(std::clamp(low, 0.0, beyond))),
          static_cast<int>(std::floor(std::clamp(high, -1.0, beyond - 1.0)))};
}

void fill(std::array<Point, 3> corner, int side, std::vector<std::uint8_t>& mask) {
  if (cross(corner[0], corner[1], corner[2]) < 0.0) std::swap(corner[1], corner[2]);
  const auto [left, right] = std::minmax({corner[0].x, corner[1].x, corner[2].x});
  const auto [top, bottom] = std::minmax({corner[0].y, corner[1].y, corner[2].y});
  const auto [first_x, last_x] = pixels_between(left, right, side);
  const auto [first_y, last_y] = pixels_between(top, bottom, side);
  for (int y = first_y; y <= last_y; ++y) {
    for (int x = first_x; x <= last_x; ++x) {
      const Point at{static_cast<double>(x), static_cast<double>(y)};
      if (cross(corner[0], corner[1], at) >= 0.0 && cross(corner[1], corner[2], at) >= 0.0 &&
          cross(corner[2], corner[0], at) >= 0.0) {
        mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(side) + static_cast<std::size_t>(x)] =
            255;
      }
    }
  }
}

}  // namespace

std::vector<std::uint8_t> fill_triangles(std::span<const float> points,
                                         std::span<const std::array<std::int32_t, 3>> faces, int side) {
  const auto pixels = static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
  std::vector<std::uint8_t> mask(pixels, 0);
  for (const auto& face : faces) {
    std::array<Point, 3> corner{};
    for (std::size_t c = 0; c < 3; ++c) {
      const auto at = static_cast<std::size_t>(face[c]);
      if (face[c] < 0 || 2 * at + 1 >= points.size()) {
        throw std::out_of_range("fill_triangles: a face names point " + std::to_string(face[c]) + " of " +
                                std::to_string(points.size() / 2));
      }
      corner[c] = {points[2 * at], points[2 * at + 1]};
    }
    if (std::all_of(corner.begin(), corner.end(), is_finite)) fill(corner, side, mask);
  }
  return mask;
}

std::vector<std::uint8_t> crop_silhouette(std::span<const float> vertices,
                                          const std::array<float, 3>& translation,
                                          std::span<const std::array<std::int32_t, 3>> faces) {
  constexpr int kSide = smal::kCropSidePx;
  std::vector<float> points;
  points.reserve(vertices.size() / 3 * 2);
  for (std::size_t v = 0; v + 2 < vertices.size(); v += 3) {
    const double depth = double{vertices[v + 2]} + translation[2];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double point = double{vertices[v + axis]} + translation[axis];
      points.push_back(depth < kNearestDepth
                           ? std::numeric_limits<float>::quiet_NaN()
                           : static_cast<float>(smal::kFocalPx * point / depth + kSide / 2));
    }
  }
  return fill_triangles(points, faces, kSide);
}

}  // namespace q3d::pipeline::render
