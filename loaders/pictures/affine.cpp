#include "loaders/pictures/affine.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace q3d::loaders::pictures {

Point map_point(const Affine& affine, Point point) {
  return {affine[0] * point.x + affine[1] * point.y + affine[2],
          affine[3] * point.x + affine[4] * point.y + affine[5]};
}

Affine compose(const Affine& second, const Affine& first) {
  const Point shift = map_point(second, {first[2], first[5]});
  return {second[0] * first[0] + second[1] * first[3], second[0] * first[1] + second[1] * first[4], shift.x,
          second[3] * first[0] + second[4] * first[3], second[3] * first[1] + second[4] * first[4], shift.y};
}

Affine invert(const Affine& affine) {
  const double determinant = affine[0] * affine[4] - affine[1] * affine[3];
  if (!std::isfinite(1.0 / determinant)) {
    throw std::invalid_argument(
        fmt::format("affine map: got determinant {}, expected one that can be inverted", determinant));
  }
  const double scale = 1.0 / determinant;
  const Affine linear{affine[4] * scale, -affine[1] * scale, 0.0, -affine[3] * scale, affine[0] * scale, 0.0};
  const Point shift = map_point(linear, {affine[2], affine[5]});
  return {linear[0], linear[1], -shift.x, linear[3], linear[4], -shift.y};
}

}  // namespace q3d::loaders::pictures
