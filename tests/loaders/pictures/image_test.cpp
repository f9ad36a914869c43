#include "loaders/pictures/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/paths.h"

namespace q3d::loaders::pictures {
namespace {

using manifests::Reason;
using ::testing::HasSubstr;

std::vector<std::byte> bytes_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  return {first, first + text.size()};
}

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  return {first, first + text.size()};
}

std::filesystem::path fixture(const std::string& name) {
  return testing::data_dir() / "images" / name;
}

// Returns what PIL's convert('RGB') made of a fixture (tests/data/images/make.py).
cv::Mat expected_rgb(const std::string& name) {
  std::vector<std::byte> bytes = bytes_of(fixture(name + ".rgb"));
  EXPECT_EQ(bytes.size(), 16U * 24U * 3U) << name;
  return cv::Mat(16, 24, CV_8UC3, bytes.data()).clone();
}

class LikePil : public ::testing::TestWithParam<std::string> {};

TEST_P(LikePil, equals_convert_rgb) {
  const DecodedImage decoded = decode_image(fixture(GetParam()));
  ASSERT_EQ(decoded.failure, Reason::none) << decoded.detail;
  const cv::Mat expected = expected_rgb(GetParam());
  ASSERT_EQ(decoded.rgb.size(), expected.size());
  ASSERT_EQ(decoded.rgb.type(), CV_8UC3);
  EXPECT_EQ(cv::norm(decoded.rgb, expected, cv::NORM_INF), 0.0);
}

std::string test_name(const ::testing::TestParamInfo<std::string>& file) {
  std::string name = file.param;
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Files, LikePil,
                         ::testing::Values("rgb.png", "grey.png", "grey_alpha.png", "grey_16.png", "rgba.png",
                                           "one_bit.png", "palette.png", "palette_transparent.png",
                                           "grey.jpg", "rgb.jpg", "rgb_444.jpg", "progressive.jpg",
                                           "cmyk.jpg", "exif_turned.jpg", "png_inside.jpg"),
                         test_name);

TEST(DecodeImage, sixteen_bit_colour_keeps_the_high_byte) {
  cv::Mat wide(2, 2, CV_16UC3, cv::Scalar(0x1234, 0x80ff, 0xfe01));  // blue, green, red
  std::vector<unsigned char> png;
  ASSERT_TRUE(cv::imencode(".png", wide, png));
  const DecodedImage decoded = decode_image(std::as_bytes(std::span(png)));
  ASSERT_EQ(decoded.failure, Reason::none) << decoded.detail;
  EXPECT_EQ(decoded.rgb.at<cv::Vec3b>(1, 1), cv::Vec3b(0xfe, 0x80, 0x12));
}

TEST(DecodeImage, every_cut_of_a_jpeg_or_png_is_truncated) {
  for (const std::string name : {"rgb.jpg", "progressive.jpg", "cmyk.jpg", "rgb.png", "palette.png"}) {
    const std::vector<std::byte> whole = bytes_of(fixture(name));
    for (std::size_t size = 8; size < whole.size(); ++size) {
      const DecodedImage decoded = decode_image(std::span(whole).first(size));
      EXPECT_EQ(decoded.failure, Reason::image_truncated)
          << name << " cut to " << size << ": " << decoded.detail;
      EXPECT_TRUE(decoded.rgb.empty());
    }
  }
}

TEST(DecodeImage, jpeg_whose_middle_is_missing_is_truncated) {
  cv::Mat noise(64, 64, CV_8UC3);
  cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, 256);
  std::vector<unsigned char> jpeg;
  ASSERT_TRUE(cv::imencode(".jpg", noise, jpeg));
  jpeg.erase(jpeg.begin() + static_cast<std::ptrdiff_t>(jpeg.size()) / 2,
             jpeg.end() - 2);  // keeps the end marker
  EXPECT_EQ(decode_image(std::as_bytes(std::span(jpeg))).failure, Reason::image_truncated);
}

TEST(DecodeImage, bytes_after_the_end_do_not_matter) {
  for (const std::string name : {"rgb.jpg", "rgb.png"}) {
    std::vector<std::byte> bytes = bytes_of(fixture(name));
    bytes.resize(bytes.size() + 100);
    EXPECT_EQ(decode_image(bytes).failure, Reason::none) << name;
  }
}

TEST(DecodeImage, flipped_bits_never_crash_and_png_notices_each) {
  for (const std::string name : {"rgb.jpg", "progressive.jpg", "cmyk.jpg", "palette.png"}) {
    const std::vector<std::byte> whole = bytes_of(fixture(name));
    const cv::Mat expected = expected_rgb(name);
    for (std::size_t i = 0; i < whole.size(); ++i) {
      std::vector<std::byte> bytes = whole;
      bytes[i] ^= std::byte{0x10};
      const DecodedImage decoded = decode_image(bytes);
      EXPECT_EQ(decoded.rgb.empty(), decoded.failure != Reason::none);
      EXPECT_EQ(decoded.detail.empty(), decoded.failure == Reason::none);
      if (name.ends_with("png")) {
        EXPECT_NE(decoded.failure, Reason::none) << "byte " << i;
      }
    }
  }
}

TEST(DecodeImage, a_png_without_its_pixels_or_palette_is_damaged) {
  // Chunks are the signature's 8 bytes, then length + 12 bytes each; these files have IHDR, [PLTE,] IDAT,
  // IEND.
  const std::vector<std::byte> rgb = bytes_of(fixture("rgb.png"));
  std::vector<std::byte> no_pixels(rgb.begin(), rgb.begin() + 8 + 25);
  no_pixels.insert(no_pixels.end(), rgb.end() - 12, rgb.end());
  EXPECT_THAT(decode_image(no_pixels).detail, HasSubstr("no pixels"));
  std::vector<std::byte> no_palette = bytes_of(fixture("palette.png"));
  const auto palette_bytes = std::to_integer<std::ptrdiff_t>(no_palette[8 + 25 + 3]) + 12;
  no_palette.erase(no_palette.begin() + 8 + 25, no_palette.begin() + 8 + 25 + palette_bytes);
  EXPECT_THAT(decode_image(no_palette).detail, HasSubstr("no palette"));
}

TEST(DecodeImage, what_is_not_a_picture_is_named) {
  struct Case {
    std::string_view content;
    Reason reason;
    const char* detail;
  };
  const std::array<Case, 6> cases{{
      {"", Reason::image_empty, "empty"},
      {"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12345\n",
       Reason::image_is_lfs_pointer, "git lfs pull"},
      {"just some text, no picture at all", Reason::image_not_an_image, "6a 75 73 74"},
      {"<!DOCTYPE html><html>quota exceeded</html>", Reason::image_not_an_image, "HTML"},
      {"GIF89a......................", Reason::image_not_an_image, "GIF"},
      {"\xff\xd8\xff\xe0 then nonsense that is no JPEG marker at all", Reason::image_truncated, "JPEG"},
  }};
  for (const Case& each : cases) {
    const DecodedImage decoded = decode_image(bytes_of(each.content));
    EXPECT_EQ(decoded.failure, each.reason) << each.content << ": " << decoded.detail;
    EXPECT_THAT(decoded.detail, HasSubstr(each.detail));
  }
}

TEST(DecodeImage, a_header_that_claims_too_much_is_refused_before_memory_is_taken) {
  std::vector<std::byte> jpeg = bytes_of(fixture("rgb.jpg"));
  const std::array<std::byte, 2> frame_marker{std::byte{0xff}, std::byte{0xc0}};
  const auto frame = std::search(jpeg.begin(), jpeg.end(), frame_marker.begin(), frame_marker.end());
  ASSERT_NE(frame, jpeg.end());
  std::fill(frame + 5, frame + 9, std::byte{0xfe});  // height and width 65,278
  const DecodedImage decoded = decode_image(jpeg);
  EXPECT_EQ(decoded.failure, Reason::image_too_large);
  EXPECT_THAT(decoded.detail, HasSubstr("65278 x 65278"));

  // IHDR of 40,000 x 40,000 px, 8-bit RGB, with its checksum (binascii.crc32).
  const DecodedImage png = decode_image(bytes_of(std::string_view(
      "\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\x9c\x40\0\0\x9c\x40\x08\x02\0\0\0\xde\x6e\x99\x52", 33)));
  EXPECT_EQ(png.failure, Reason::image_too_large) << png.detail;
}

TEST(ReadPictureFile, missing_folder_and_unreadable) {
  const testing::ScratchDir scratch;
  EXPECT_EQ(read_picture_file(scratch.path() / "none.jpg").failure, Reason::image_missing);
  EXPECT_EQ(read_picture_file(scratch.path()).failure, Reason::image_not_an_image);
  std::filesystem::create_symlink("nowhere.jpg", scratch.path() / "broken.jpg");
  const FileBytes broken = read_picture_file(scratch.path() / "broken.jpg");
  EXPECT_EQ(broken.failure, Reason::image_missing);
  EXPECT_THAT(broken.detail, HasSubstr("broken.jpg"));
  EXPECT_EQ(read_picture_file(fixture("rgb.png")).bytes, bytes_of(fixture("rgb.png")));
}

std::vector<std::byte> png_of(const cv::Mat& image) {
  std::vector<unsigned char> png;
  EXPECT_TRUE(cv::imencode(".png", image, png));
  const auto bytes = std::as_bytes(std::span(png));
  return {bytes.begin(), bytes.end()};
}

TEST(DecodeMask, kinds_are_told_apart) {
  cv::Mat mask(40, 40, CV_8UC1, cv::Scalar(0));
  EXPECT_EQ(decode_mask(png_of(mask)).kind, MaskKind::blank);
  EXPECT_TRUE(decode_mask(png_of(mask)).silhouette.empty());

  mask(cv::Rect(10, 10, 20, 20)) = 1;
  const DecodedMask ones = decode_mask(png_of(mask));
  EXPECT_EQ(ones.kind, MaskKind::low_valued);
  EXPECT_EQ(cv::norm(ones.silhouette, mask * 255, cv::NORM_INF), 0.0);

  mask(cv::Rect(10, 10, 20, 20)) = 255;
  mask(cv::Rect(9, 10, 1, 20)) = 128;  // a soft edge
  const DecodedMask silhouette = decode_mask(png_of(mask));
  EXPECT_EQ(silhouette.kind, MaskKind::silhouette);
  EXPECT_EQ(cv::norm(silhouette.silhouette, mask, cv::NORM_INF), 0.0);

  const DecodedMask photograph = decode_mask(fixture("rgb.jpg"));
  EXPECT_EQ(photograph.kind, MaskKind::picture);
  EXPECT_TRUE(photograph.silhouette.empty());
}

TEST(DecodeMask, colours_become_grey_as_pil_does) {
  // PIL: (19595 R + 38470 G + 7471 B + 32768) >> 16 = 76, 150, 29 for pure red, green, blue.
  cv::Mat colours(10, 30, CV_8UC3, cv::Scalar::all(0));
  colours(cv::Rect(0, 0, 1, 1)) = cv::Scalar(0, 0, 255);
  colours(cv::Rect(1, 0, 1, 1)) = cv::Scalar(0, 255, 0);
  colours(cv::Rect(2, 0, 1, 1)) = cv::Scalar(255, 0, 0);
  const DecodedMask mask = decode_mask(png_of(colours));
  ASSERT_EQ(mask.kind, MaskKind::silhouette);
  EXPECT_EQ(mask.silhouette.at<std::uint8_t>(0, 0), 76);
  EXPECT_EQ(mask.silhouette.at<std::uint8_t>(0, 1), 150);
  EXPECT_EQ(mask.silhouette.at<std::uint8_t>(0, 2), 29);
}

TEST(DecodeMask, absent_and_missing_differ) {
  EXPECT_EQ(decode_mask(std::filesystem::path()).kind, MaskKind::absent);
  EXPECT_EQ(decode_mask(std::filesystem::path()).failure, Reason::none);
  EXPECT_EQ(decode_mask(std::filesystem::path("/nonexistent/mask.png")).failure, Reason::image_missing);
}

}  // namespace
}  // namespace q3d::loaders::pictures
