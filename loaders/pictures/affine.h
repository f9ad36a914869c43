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

// Returns the map that applies `first` and then `second`.
Affine compose(const Affine& second, const Affine& first);

// Returns the inverse map. Throws std::invalid_argument if there is none.
Affine invert(const Affine& affine);

}  // namespace q3d::loaders::pictures
