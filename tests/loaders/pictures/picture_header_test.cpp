#include "loaders/pictures/picture_header.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "loaders/pictures/image.h"
#include "tests/support/paths.h"

namespace q3d::loaders::pictures {
namespace {

std::vector<std::byte> as_bytes(const std::string& text) {
  const auto* start = reinterpret_cast<const std::byte*>(text.data());
  return {start, start + text.size()};
}

std::string file_content(const std::string& name) {
  std::ifstream stream(q3d::testing::data_dir() / "images" / name, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// A TIFF block whose first directory has the orientation, in either byte order, after another tag.
std::string tiff(char order, int orientation) {
  const bool is_big = order == 'M';
  const auto number = [&](unsigned value, int size) {
    std::string digits;
    for (int i = 0; i < size; ++i) {
      const int shift = 8 * (is_big ? size - 1 - i : i);
      digits += static_cast<char>(value >> static_cast<unsigned>(shift));
    }
    return digits;
  };
  const std::string make = number(0x010f, 2) + number(2, 2) + number(4, 4) + "abc" + '\0';
  const std::string turn = number(0x0112, 2) + number(3, 2) + number(1, 4) +
                           number(static_cast<unsigned>(orientation), 2) + number(0, 2);
  return std::string(2, order) + number(42, 2) + number(8, 4) + number(2, 2) + make + turn + number(0, 4);
}

std::string with_exif(const std::string& jpeg, const std::string& block) {
  const std::string segment = std::string("Exif\0\0", 6) + block;
  const std::size_t length = segment.size() + 2;
  return jpeg.substr(0, 2) + "\xff\xe1" + static_cast<char>(length >> 8U) + static_cast<char>(length) +
         segment + jpeg.substr(2);
}

int orientation_with(const std::string& block) {
  const auto header = read_picture_header(as_bytes(with_exif(file_content("rgb.jpg"), block)));
  return header && header->width_px == 24 && header->height_px == 16 ? header->orientation : -1;
}

// Every picture of the folder: the header's size is that of the decoded pixels.
TEST(PictureHeader, has_the_size_of_the_pixels) {
  int pictures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(q3d::testing::data_dir() / "images")) {
    const auto ending = entry.path().extension();
    if (ending != ".jpg" && ending != ".png") continue;
    const auto header = read_picture_header(entry.path());
    ASSERT_TRUE(header) << entry.path();
    const DecodedImage image = decode_image(entry.path());
    EXPECT_EQ(header->width_px, image.rgb.cols) << entry.path();
    EXPECT_EQ(header->height_px, image.rgb.rows) << entry.path();
    EXPECT_EQ(header->orientation, entry.path().filename() == "exif_turned.jpg" ? 6 : 1) << entry.path();
    ++pictures;
  }
  EXPECT_GT(pictures, 10);
}

TEST(PictureHeader, reads_every_orientation_in_both_byte_orders) {
  for (int orientation = 1; orientation <= 8; ++orientation) {
    EXPECT_EQ(orientation_with(tiff('I', orientation)), orientation);
    EXPECT_EQ(orientation_with(tiff('M', orientation)), orientation);
  }
}

TEST(PictureHeader, a_damaged_block_has_no_orientation) {
  EXPECT_EQ(orientation_with(tiff('M', 0)), 1);
  EXPECT_EQ(orientation_with(tiff('M', 9)), 1);
  EXPECT_EQ(orientation_with(""), 1);
  EXPECT_EQ(orientation_with("MM"), 1);
  EXPECT_EQ(orientation_with("XX" + tiff('M', 6).substr(2)), 1);
  const std::string whole = tiff('M', 6);
  for (std::size_t size = 0; size < whole.size() - 4; ++size) {
    EXPECT_EQ(orientation_with(whole.substr(0, size)), size >= 34 ? 6 : 1) << size;
  }
  std::string far = whole;
  far[4] = '\x7f';  // the directory lies beyond the end
  EXPECT_EQ(orientation_with(far), 1);
}

// Cut anywhere or with any byte changed, a header is read or refused, and never beyond the end.
// A file of nothing but bytes that fill would be gone through one by one.
TEST(PictureHeader, the_way_to_the_frame_is_bounded) {
  const std::string jpeg = file_content("rgb.jpg");
  const auto filled = [&](std::size_t count) {
    return as_bytes(jpeg.substr(0, 2) + std::string(count, '\xff') + jpeg.substr(2));
  };
  EXPECT_TRUE(read_picture_header(filled(1000)));
  EXPECT_FALSE(read_picture_header(filled(1'000'000)));
}

TEST(PictureHeader, damaged_files_are_refused) {
  for (const char* name : {"exif_turned.jpg", "palette.png"}) {
    const std::string whole = file_content(name);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const auto header = read_picture_header(as_bytes(whole.substr(0, size)));
      if (header) {
        EXPECT_EQ(header->width_px, 24);
      }
      std::string damaged = whole;
      damaged[size] = static_cast<char>(damaged[size] ^ 0x5a);
      read_picture_header(as_bytes(damaged));
    }
    EXPECT_FALSE(read_picture_header(as_bytes(whole.substr(0, 20))));
  }
  EXPECT_FALSE(read_picture_header(as_bytes("GIF89a, which is another picture")));
  EXPECT_FALSE(read_picture_header(std::filesystem::path("/nonexistent/picture.png")));
}

}  // namespace
}  // namespace q3d::loaders::pictures
