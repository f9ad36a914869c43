// 2x3 affine maps between pixel grids, row-major: (x', y') = (a0 x + a1 y + a2, a3 x + a4 y + a5).
#pragma once

#include <array>

namespace q3d::loaders::pictures {

using Affine = std::array<double, 6>;

struct Point {
  double x = 0.0;
  double y = 0.0;
};

Point map_point(const Affine& affine, Point point);

// `second` after `first`.
Affine compose(const Affine& second, const Affine& first);

// Throws std::invalid_argument when the map has no inverse.
Affine invert(const Affine& affine);

}  // namespace q3d::loaders::pictures
