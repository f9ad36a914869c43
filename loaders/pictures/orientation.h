// An EXIF orientation says how a viewer turns the stored pixels before it shows them.
#pragma once

#include <opencv2/core.hpp>

namespace q3d::loaders::pictures {

// Returns whether the orientation (EXIF's, 1 to 8) exchanges width and height.
bool exchanges_sides(int orientation);

// Returns the picture as a viewer shows it: 2 and 4 are mirrored, 3 is upside down, 5 to 8 lie on a side (5
// and 7 also mirrored). Every other value returns the picture itself. Equal to PIL's ImageOps.exif_transpose.
cv::Mat turned(const cv::Mat& picture, int orientation);

}  // namespace q3d::loaders::pictures
