// The hash must see through some changes of a picture, and not through others.
#include "loaders/pictures/perceptual_hash.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "loaders/formats/picture_origin.h"

namespace q3d::loaders::pictures {
namespace {

using manifests::PictureHash;

// Ellipses of many colours and sizes: structure at all scales, as photographs have.
cv::Mat drawn(unsigned seed, cv::Size size = {400, 300}) {
  std::mt19937 engine(seed);
  const auto below = [&](int limit) { return static_cast<int>(engine() % static_cast<unsigned>(limit)); };
  cv::Mat picture(size, CV_8UC3, cv::Scalar(below(256), below(256), below(256)));
  for (int i = 0; i < 40; ++i) {
    cv::ellipse(picture, {below(size.width), below(size.height)}, {10 + below(90), 10 + below(60)},
                below(180), 0, 360, cv::Scalar(below(256), below(256), below(256)), cv::FILLED);
  }
  return picture;
}

PictureHash hash_of(const cv::Mat& picture) {
  const auto hash = perceptual_hash(picture);
  EXPECT_TRUE(hash.has_value());
  return hash.value_or(PictureHash{});
}

int distance(std::uint64_t a, std::uint64_t b) {
  return std::popcount(a ^ b);
}

// A product of cosines is one coefficient of the DCT; all others are rounding noise around 0, and so is the
// median. Its bit is its place in JPEG's zigzag (ITU-T T.81, figure 5), which goes right first.
TEST(PerceptualHash, a_cosine_sets_the_bit_of_its_frequency) {
  struct Wave {
    int vertical, horizontal, bit;
  };
  for (const Wave& wave :
       {Wave{0, 1, 0}, Wave{1, 0, 1}, Wave{2, 0, 2}, Wave{1, 1, 3}, Wave{0, 2, 4}, Wave{0, 3, 5}}) {
    for (const double sign : {1.0, -1.0}) {
      cv::Mat picture(32, 32, CV_8UC3);
      for (int y = 0; y < 32; ++y) {
        for (int x = 0; x < 32; ++x) {
          const double value = std::cos(std::numbers::pi * (2 * x + 1) * wave.horizontal / 64) *
                               std::cos(std::numbers::pi * (2 * y + 1) * wave.vertical / 64);
          picture.at<cv::Vec3b>(y, x) =
              cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(128 + 100 * sign * value));
        }
      }
      const PictureHash hash = hash_of(picture);
      EXPECT_EQ((hash.upright >> wave.bit) & 1U, sign > 0 ? 1U : 0U)
          << wave.vertical << ", " << wave.horizontal << " sign " << sign;
      const bool changes = wave.horizontal % 2 == 1;
      EXPECT_EQ((hash.mirrored >> wave.bit) & 1U, (sign > 0) != changes ? 1U : 0U);
    }
  }
}

TEST(PerceptualHash, half_of_the_bits_are_set) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const PictureHash hash = hash_of(drawn(seed));
    EXPECT_EQ(std::popcount(hash.upright), 32);
    EXPECT_EQ(std::popcount(hash.mirrored), 32);
  }
}

TEST(PerceptualHash, sees_through_resizing_recompression_and_mirroring) {
  constexpr int kLimit = 4;  // the config's default
  for (unsigned seed = 0; seed < 30; ++seed) {
    const cv::Mat picture = drawn(seed);
    const PictureHash hash = hash_of(picture);
    cv::Mat changed;
    for (const double scale : {0.35, 0.5, 2.0}) {
      cv::resize(picture, changed, {}, scale, scale, cv::INTER_LINEAR);
      EXPECT_LE(distance(hash_of(changed).upright, hash.upright), kLimit) << seed << " scale " << scale;
    }
    for (const int quality : {95, 50, 20}) {
      std::vector<std::uint8_t> bytes;
      cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
      EXPECT_LE(distance(hash_of(cv::imdecode(bytes, cv::IMREAD_COLOR)).upright, hash.upright), kLimit)
          << seed << " quality " << quality;
    }
    cv::flip(picture, changed, 1);
    EXPECT_LE(distance(hash_of(changed).upright, hash.mirrored), 2) << seed << " mirrored";
    cv::resize(changed, changed, {}, 0.6, 0.6, cv::INTER_AREA);
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", changed, bytes, {cv::IMWRITE_JPEG_QUALITY, 40});
    EXPECT_LE(distance(hash_of(cv::imdecode(bytes, cv::IMREAD_COLOR)).mirrored, hash.upright), kLimit)
        << seed << " all three";
  }
}

TEST(PerceptualHash, tells_other_pictures_apart) {
  std::vector<PictureHash> hashes;
  for (unsigned seed = 0; seed < 200; ++seed) hashes.push_back(hash_of(drawn(1000 + seed)));
  int least = 64;
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      least = std::min({least, distance(hashes[i].upright, hashes[j].upright),
                        distance(hashes[i].mirrored, hashes[j].upright)});
    }
  }
  EXPECT_GT(least, 4) << "of 19,900 pairs, upright and mirrored";
}

TEST(PerceptualHash, one_colour_has_none_and_other_types_are_refused) {
  EXPECT_FALSE(perceptual_hash(cv::Mat(50, 60, CV_8UC3, cv::Scalar(1, 200, 30))));
  EXPECT_THROW(perceptual_hash(cv::Mat(50, 60, CV_8UC1)), std::invalid_argument);
  EXPECT_THROW(perceptual_hash(cv::Mat()), std::invalid_argument);
}

TEST(PictureOrigin, joins_what_took_the_same_picture) {
  EXPECT_EQ(formats::picture_origin("images/train/wolf/n02114367_52.JPEG"), "imagenet n02114367_52");
  EXPECT_EQ(formats::picture_origin("n02114367_52_13677.jpg"),
            "imagenet n02114367_52");  // SuperAnimal adds its number
  EXPECT_EQ(formats::picture_origin("N02114367_52.png"), "imagenet n02114367_52");
  EXPECT_EQ(formats::picture_origin("images/000000015956_horse.jpg"), "coco 000000015956");
  EXPECT_EQ(formats::picture_origin("a\\b\\2010_001705.jpg"), "voc 2010_001705");
  EXPECT_EQ(formats::picture_origin("2010_001705_77.jpg"), "voc 2010_001705");
}

TEST(PictureOrigin, says_nothing_of_numbers_that_are_a_dataset_s_own) {
  EXPECT_EQ(formats::picture_origin("000000000004.jpg"), "") << "AP-10K's, or COCO's";
  EXPECT_EQ(formats::picture_origin("000000000004_1234.jpg"), "") << "AP-10K in SuperAnimal";
  EXPECT_EQ(formats::picture_origin("horse_11361_13677.jpg"), "");
  EXPECT_EQ(formats::picture_origin("n0211436_52.jpg"), "");
  EXPECT_EQ(formats::picture_origin("n02114367_.jpg"), "");
  EXPECT_EQ(formats::picture_origin("n02114367_5b.jpg"), "");
  EXPECT_EQ(formats::picture_origin("20100_001705.jpg"), "");
  EXPECT_EQ(formats::picture_origin(""), "");
}

}  // namespace
}  // namespace q3d::loaders::pictures
