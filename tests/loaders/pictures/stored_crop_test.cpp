#include "loaders/pictures/stored_crop.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "loaders/pictures/augment.h"
#include "loaders/pictures/encode.h"
#include "loaders/pictures/jpeg.h"

namespace q3d::loaders::pictures {
namespace {

cv::Mat noise(cv::Size size, int type, std::uint64_t seed) {
  cv::Mat image(size, type);
  cv::RNG(seed).fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

TEST(Affine, compose_and_invert) {
  const Affine turn{0.0, -2.0, 5.0, 2.0, 0.0, -1.0};  // quarter turn, twice as large, shifted
  const Affine shift{1.0, 0.0, 10.0, 0.0, 1.0, 20.0};
  const Point both = map_point(compose(turn, shift), {1.0, 2.0});  // shift first: (11, 22)
  EXPECT_DOUBLE_EQ(both.x, -39.0);
  EXPECT_DOUBLE_EQ(both.y, 21.0);
  const Point back = map_point(invert(turn), map_point(turn, {3.0, -7.0}));
  EXPECT_DOUBLE_EQ(back.x, 3.0);
  EXPECT_DOUBLE_EQ(back.y, -7.0);
  EXPECT_THROW(invert({1.0, 2.0, 0.0, 2.0, 4.0, 0.0}), std::invalid_argument);
}

cv::Mat smooth(int side, std::uint64_t seed) {
  cv::Mat picture = noise({side, side}, CV_8UC3, seed);
  cv::GaussianBlur(picture, picture, {9, 9}, 3.0);
  return picture;
}

// Colours of neighbours and block edges are where a part could differ from the whole.
TEST(StoredCrop, a_region_of_a_jpeg_has_the_pixels_of_the_whole) {
  const std::vector<std::byte> jpeg = encode_jpeg(smooth(301, 5), 90);
  const cv::Mat whole = decode_jpeg(jpeg).rgb;
  std::mt19937_64 engine(3);
  const auto draw = [&engine](int below) {
    return static_cast<int>(engine() % static_cast<unsigned>(below));
  };
  for (int i = 0; i < 300; ++i) {
    const cv::Rect wanted(draw(340) - 30, draw(340) - 30, 1 + draw(200), 1 + draw(200));
    const cv::Rect inside = wanted & cv::Rect(0, 0, 301, 301);
    if (inside.empty()) continue;
    const DecodedRegion region = decode_jpeg_region(jpeg, wanted);
    const cv::Rect place(region.origin, region.image.rgb.size());
    ASSERT_EQ(place & inside, inside) << wanted;
    ASSERT_EQ(cv::norm(region.image.rgb(inside - region.origin), whole(inside), cv::NORM_INF), 0.0) << wanted;
  }
}

// Cutting a patch from the region that it needs gives the patch that the whole crop gives.
TEST(StoredCrop, a_patch_of_its_region_is_that_of_the_whole) {
  const std::vector<std::byte> jpeg = encode_jpeg(smooth(480, 6), 95);
  const std::vector<std::byte> png = encode_png(smooth(480, 6));
  std::mt19937_64 engine(4);
  std::size_t pixels = 0;
  for (int i = 0; i < 60; ++i) {
    const SquareBox box{240.0 + i % 7, 235.0, 253.0};
    const Affine patch_from_crop = augmented_patch_from_image(box, draw_augmentation({}, engine));
    for (const std::vector<std::byte>& bytes : {jpeg, png}) {
      const cv::Mat whole = is_jpeg(bytes) ? decode_jpeg(bytes).rgb : decode_stored(bytes, 3);
      const StoredRegion region = decode_stored_for(bytes, patch_from_crop);
      const Affine shift{1.0, 0.0, 1.0 * region.origin.x, 0.0, 1.0, 1.0 * region.origin.y};
      const cv::Mat part = warp_patch(region.rgb, {}, compose(patch_from_crop, shift)).rgb;
      const cv::Mat expected = warp_patch(whole, {}, patch_from_crop).rgb;
      // A position that lies between two multiples of 1/32 px may be rounded the other way.
      cv::Mat differs;
      cv::absdiff(part, expected, differs);
      ASSERT_LE(cv::countNonZero(differs.reshape(1)), 6) << i;
      if (is_jpeg(bytes)) pixels += region.rgb.total();
    }
  }
  EXPECT_LT(pixels, 60U * 480U * 480U * 3U / 4U) << "the region is not much smaller than the crop";
}

TEST(StoredCrop, every_augmented_patch_lies_inside) {
  std::mt19937_64 engine(11);
  const cv::Mat rgb = noise({900, 700}, CV_8UC3, 1);
  for (const double side : {3.0, 41.0, 250.0, 333.0}) {
    const SquareBox box{450.0, 350.0, side};
    const StoredCrop crop = make_stored_crop(rgb, {}, box);
    for (int i = 0; i < 300; ++i) {
      Augmentation drawn = draw_augmentation({}, engine);
      if (i < 8) drawn = {1.3, 45.0 + 90.0 * (i % 4), i < 4 ? 0.02 : -0.02, i < 4 ? -0.02 : 0.02, {1, 1, 1}};
      const Affine back =
          invert(patch_from_stored_crop(augmented_patch_from_image(box, drawn), crop.from_image));
      for (const Point corner : {Point{0, 0}, Point{255, 0}, Point{0, 255}, Point{255, 255}}) {
        const Point at = map_point(back, corner);
        EXPECT_GE(std::min(at.x, at.y), 0.0) << "side " << side;
        EXPECT_LE(std::max(at.x, at.y), crop.rgb.cols - 1.0) << "side " << side;
      }
    }
  }
}

TEST(StoredCrop, a_patch_cut_from_unreduced_pixels_is_the_patch_of_the_image) {
  const cv::Mat rgb = noise({400, 300}, CV_8UC3, 2);
  const cv::Mat mask = noise({400, 300}, CV_8UC1, 3);
  std::mt19937_64 engine(5);
  // The last two boxes reach over the border of the image.
  for (const SquareBox& box : {SquareBox{200, 150, 120}, SquareBox{199.5, 140.25, 77.3},
                               SquareBox{20, 280, 150}, SquareBox{390, 10, 240}}) {
    const StoredCrop crop = make_stored_crop(rgb, mask, box);
    ASSERT_LT(crop.rgb.cols, 480);
    EXPECT_EQ(crop.from_image[0], 1.0);
    for (int i = 0; i < 20; ++i) {
      const Affine from_image = augmented_patch_from_image(box, draw_augmentation({}, engine));
      const Patch direct = warp_patch(rgb, mask, from_image);
      const Patch stored =
          warp_patch(crop.rgb, crop.mask, patch_from_stored_crop(from_image, crop.from_image));
      // A coordinate that rounds the other way moves by 1/32 px: at most 255 / 32 grey levels.
      EXPECT_LE(cv::norm(direct.rgb, stored.rgb, cv::NORM_INF), 8.0);
      EXPECT_LE(cv::norm(direct.mask, stored.mask, cv::NORM_INF), 8.0);
      EXPECT_LT(cv::countNonZero(direct.mask != stored.mask), kPatchSidePx * kPatchSidePx / 100);
    }
  }
}

TEST(StoredCrop, reduction_is_the_mean_over_the_area) {
  const cv::Mat rgb = noise({1200, 1100}, CV_8UC3, 4);
  const cv::Mat mask = noise({1200, 1100}, CV_8UC1, 5);
  // 956 px and two at each side are 960 px: each crop pixel is the mean of 2 x 2, starting at (120, 20).
  const StoredCrop crop = make_stored_crop(rgb, mask, {600, 500, 478}, 2.0, 480);
  ASSERT_EQ(crop.rgb.size(), cv::Size(480, 480));
  cv::Mat expected;
  cv::resize(rgb(cv::Rect(120, 20, 960, 960)), expected, {480, 480}, 0, 0, cv::INTER_AREA);
  EXPECT_LE(cv::norm(crop.rgb, expected, cv::NORM_INF), 1.0);
  cv::resize(mask(cv::Rect(120, 20, 960, 960)), expected, {480, 480}, 0, 0, cv::INTER_AREA);
  EXPECT_LE(cv::norm(crop.mask, expected, cv::NORM_INF), 1.0);
  // The centre of crop pixel 0 is the corner between image pixels 120 and 121.
  const Point origin = map_point(crop.from_image, {120.5, 20.5});
  EXPECT_NEAR(origin.x, 0.0, 1e-12);
  EXPECT_NEAR(origin.y, 0.0, 1e-12);
}

TEST(StoredCrop, pixels_stay_where_the_affine_says_under_any_reduction) {
  cv::Mat ramp(1500, 1500, CV_8UC3);  // red rises along x, green along y: one grey level in 6 px
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) {
      ramp.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(x / 6), static_cast<std::uint8_t>(y / 6), 7};
    }
  }
  const StoredCrop crop = make_stored_crop(ramp, {}, {760, 701, 391.7});
  ASSERT_EQ(crop.rgb.cols, 480);
  const Affine image_from_crop = invert(crop.from_image);
  for (int v = 5; v < 480; v += 53) {
    for (int u = 5; u < 480; u += 47) {
      const Point image = map_point(image_from_crop, {1.0 * u, 1.0 * v});
      EXPECT_NEAR(crop.rgb.at<cv::Vec3b>(v, u)[0], (image.x - 2.5) / 6.0, 0.9);
      EXPECT_NEAR(crop.rgb.at<cv::Vec3b>(v, u)[1], (image.y - 2.5) / 6.0, 0.9);
    }
  }
}

TEST(StoredCrop, a_box_far_larger_than_the_picture_costs_no_memory_of_its_size) {
  const cv::Mat rgb(60, 80, CV_8UC3, cv::Scalar::all(255));
  const StoredCrop crop = make_stored_crop(rgb, {}, {40, 30, 400'000}, 1.9, 480);
  EXPECT_EQ(crop.rgb.size(), cv::Size(480, 480));
  EXPECT_TRUE(crop.mask.empty());
}

TEST(StoredCrop, refuses_what_it_cannot_crop) {
  const cv::Mat rgb(60, 80, CV_8UC3);
  EXPECT_THROW(make_stored_crop({}, {}, {40, 30, 20}), std::invalid_argument);
  EXPECT_THROW(make_stored_crop(rgb, cv::Mat(60, 81, CV_8UC1), {40, 30, 20}), std::invalid_argument);
  EXPECT_THROW(make_stored_crop(rgb, {}, {40, 30, 20}, 0.5), std::invalid_argument);
  EXPECT_THROW(make_stored_crop(rgb, {}, {40, 30, 20}, 1.9, 100), std::invalid_argument);
}

TEST(Encode, leaves_the_picture_as_it_was) {
  const cv::Mat rgb = noise({40, 30}, CV_8UC3, 9);
  const cv::Mat before = rgb.clone();
  encode_jpeg(rgb, 90);
  const std::vector<std::byte> png = encode_png(rgb);
  EXPECT_EQ(cv::norm(rgb, before, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(decode_stored(png, 3), before, cv::NORM_INF), 0.0);
}

TEST(Augmentation, draws_follow_the_official_distributions) {
  std::mt19937_64 engine(3);
  int rotated = 0;
  double sum = 0.0;
  double squares = 0.0;
  constexpr int kDraws = 20'000;
  for (int i = 0; i < kDraws; ++i) {
    const Augmentation drawn = draw_augmentation({}, engine);
    EXPECT_LE(std::abs(drawn.shift_x), 0.02);
    EXPECT_LE(std::abs(drawn.scale - 1.0), 0.3 + 1e-12);
    EXPECT_LE(std::abs(drawn.rotation_deg), 60.0);
    for (const double channel : drawn.colour) EXPECT_LE(std::abs(channel - 1.0), 0.2);
    rotated += drawn.rotation_deg != 0.0 ? 1 : 0;
    sum += drawn.scale - 1.0;
    squares += (drawn.scale - 1.0) * (drawn.scale - 1.0);
  }
  EXPECT_NEAR(static_cast<double>(rotated) / kDraws, 0.6, 0.02);
  EXPECT_NEAR(sum / kDraws, 0.0, 0.005);
  // A standard normal number cut at +-1 has variance P(|z|>1) + E[z^2; |z|<1] = 0.3173 + 0.1987 = 0.5160.
  EXPECT_NEAR(squares / kDraws, 0.09 * 0.5160, 0.001);
}

TEST(Augmentation, equal_seeds_draw_equal_values) {
  std::mt19937_64 first(9);
  std::mt19937_64 second(9);
  EXPECT_EQ(draw_augmentation({}, first).scale, draw_augmentation({}, second).scale);
}

TEST(Augmentation, half_turns_and_small_angles_keep_their_axis) {
  constexpr float kPi = 3.14159265358979F;
  // No rotation added: what comes back is the same rotation with an angle in [0, pi].
  const std::array<float, 3> wrapped = rotate_global_orient({0.0F, 1.5F * kPi, 0.0F}, 0.0);
  EXPECT_NEAR(wrapped[1], -0.5F * kPi, 1e-6);
  const std::array<float, 3> half = rotate_global_orient({0.0F, 0.0F, kPi / 2}, -90.0);
  EXPECT_NEAR(std::abs(half[2]), kPi, 1e-6);
  const std::array<float, 3> none = rotate_global_orient({0.0F, 0.0F, 0.0F}, 0.0);
  EXPECT_EQ(none, (std::array<float, 3>{0.0F, 0.0F, 0.0F}));
  const std::array<float, 3> small = rotate_global_orient({1e-4F, 0.0F, 0.0F}, 0.0);
  EXPECT_NEAR(small[0], 1e-4F, 1e-9);
}

TEST(Patch, replicated_border_leaves_the_mask_black_outside) {
  const cv::Mat rgb(50, 50, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat mask(50, 50, CV_8UC1, cv::Scalar(255));
  const Affine affine = patch_from_image({0, 0, 50}, kPatchSidePx);  // three quarters lie outside
  const Patch patch = warp_patch(rgb, mask, affine, Border::replicate);
  EXPECT_EQ(patch.rgb.at<cv::Vec3b>(5, 5), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(patch.mask.at<std::uint8_t>(5, 5), 0);
  EXPECT_EQ(patch.mask.at<std::uint8_t>(250, 250), 255);
  EXPECT_TRUE(patch.has_mask);
  EXPECT_EQ(warp_patch(rgb, mask, affine).rgb.at<cv::Vec3b>(5, 5), cv::Vec3b(0, 0, 0));
}

TEST(Patch, a_mask_that_never_reaches_half_becomes_all_ones) {
  const cv::Mat rgb(50, 50, CV_8UC3, cv::Scalar(10, 20, 30));
  const Patch patch = make_patch(rgb, cv::Mat(50, 50, CV_8UC1, cv::Scalar(127)), {25, 25, 50});
  EXPECT_FALSE(patch.has_mask);
  EXPECT_EQ(cv::countNonZero(patch.mask == 255), kPatchSidePx * kPatchSidePx);
  EXPECT_TRUE(make_patch(rgb, cv::Mat(50, 50, CV_8UC1, cv::Scalar(128)), {25, 25, 50}).has_mask);
}

}  // namespace
}  // namespace q3d::loaders::pictures
