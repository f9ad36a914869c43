#include "loaders/pictures/orientation.h"

namespace q3d::loaders::pictures {

bool exchanges_sides(int orientation) {
  return orientation >= 5 && orientation <= 8;
}

cv::Mat turned(const cv::Mat& picture, int orientation) {
  constexpr int kUpsideDown = 0;
  constexpr int kLeftRight = 1;
  constexpr int kBoth = -1;
  if (orientation < 2 || orientation > 8) return picture;
  cv::Mat result = exchanges_sides(orientation) ? cv::Mat(picture.t()) : picture.clone();
  switch (orientation) {
    case 2:
    case 6:
      cv::flip(result, result, kLeftRight);
      break;
    case 3:
    case 7:
      cv::flip(result, result, kBoth);
      break;
    case 4:
    case 8:
      cv::flip(result, result, kUpsideDown);
      break;
    default:
      break;
  }
  return result;
}

}  // namespace q3d::loaders::pictures
