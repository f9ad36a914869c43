#include "loaders/pictures/orientation.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace q3d::loaders::pictures {
namespace {

// The corners of EXIF's definition (JEITA CP-3451, tag 0x0112): orientation N says which side of the scene
// the stored row 0 and column 0 show. A stored picture of 3 x 2 pixels
//   1 2 3
//   4 5 6
// is shown as follows.
struct Shown {
  int orientation;
  int columns;
  std::vector<int> pixels;
};

TEST(Turned, follows_exif) {
  const cv::Mat stored = (cv::Mat_<std::uint8_t>(2, 3) << 1, 2, 3, 4, 5, 6);
  for (const Shown& shown :
       {Shown{1, 3, {1, 2, 3, 4, 5, 6}}, Shown{2, 3, {3, 2, 1, 6, 5, 4}}, Shown{3, 3, {6, 5, 4, 3, 2, 1}},
        Shown{4, 3, {4, 5, 6, 1, 2, 3}}, Shown{5, 2, {1, 4, 2, 5, 3, 6}}, Shown{6, 2, {4, 1, 5, 2, 6, 3}},
        Shown{7, 2, {6, 3, 5, 2, 4, 1}}, Shown{8, 2, {3, 6, 2, 5, 1, 4}}, Shown{0, 3, {1, 2, 3, 4, 5, 6}},
        Shown{9, 3, {1, 2, 3, 4, 5, 6}}}) {
    const cv::Mat picture = turned(stored, shown.orientation);
    ASSERT_EQ(picture.cols, shown.columns) << shown.orientation;
    EXPECT_EQ(std::vector<int>(picture.begin<std::uint8_t>(), picture.end<std::uint8_t>()), shown.pixels)
        << shown.orientation;
    EXPECT_EQ(exchanges_sides(shown.orientation), shown.columns == 2);
    EXPECT_EQ(stored.at<std::uint8_t>(0, 0), 1) << "the stored picture stays";
  }
}

}  // namespace
}  // namespace q3d::loaders::pictures
