#include "loaders/formats/numbered_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using ::testing::HasSubstr;

std::vector<std::string> rows(int first, int count) {
  std::vector<std::string> numbers;
  for (int i = first; i < first + count; ++i) numbers.push_back(std::to_string(i));
  return numbers;
}

class Numbered : public ::testing::Test {
 protected:
  NumberedPictures with(int first, int count, int step = 1) {
    std::filesystem::remove_all(folder());
    for (int i = 0; i < count; ++i)
      write_text(folder() / ("f" + std::to_string(first + i * step) + ".PNG"), "x");
    write_text(folder() / "labels_77.csv", "x");
    return NumberedPictures(folder());
  }
  std::filesystem::path folder() const { return scratch_.path() / "frames"; }

 private:
  q3d::testing::ScratchDir scratch_;
};

TEST_F(Numbered, no_doubt_where_every_frame_has_its_picture) {
  EXPECT_EQ(with(0, 4).doubt(rows(0, 4)), "");
  EXPECT_EQ(with(0, 9).doubt(rows(0, 4)), "");
  EXPECT_EQ(with(5, 4).doubt(rows(5, 4)), "");
  EXPECT_EQ(with(1, 4).doubt(rows(1, 4)), "") << "rows that count from 1 too";
  EXPECT_EQ(with(0, 0).doubt(rows(0, 4)), "") << "no pictures at all: each frame fails by itself";
}

TEST_F(Numbered, no_doubt_about_single_frames_of_a_video) {
  EXPECT_EQ(with(0, 3).doubt(rows(0, 100)), "");
  EXPECT_EQ(with(12, 3, 20).doubt(rows(0, 100)), "");
  EXPECT_EQ(with(40, 3).doubt(rows(0, 100)), "");
}

TEST_F(Numbered, fewer_pictures_than_frames_may_be_every_nth) {
  EXPECT_TRUE(with(0, 3).may_be_every_nth(rows(0, 100)));
  EXPECT_FALSE(with(0, 4).may_be_every_nth(rows(0, 4)));
  EXPECT_FALSE(with(0, 9).may_be_every_nth(rows(0, 4)));
  EXPECT_FALSE(with(12, 3).may_be_every_nth(rows(0, 100)));
  EXPECT_FALSE(with(0, 3, 20).may_be_every_nth(rows(0, 100))) << "the frames' own numbers";
  EXPECT_FALSE(with(0, 1).may_be_every_nth(rows(0, 100)));
}

TEST_F(Numbered, doubt_where_counts_are_shifted) {
  EXPECT_THAT(with(1, 4).doubt(rows(0, 4)),
              HasSubstr("4 frames numbered 0 to 3 and 4 pictures numbered 1 to 4"));
  EXPECT_NE(with(1, 3).doubt(rows(0, 4)), "") << "a picture too few";
  EXPECT_NE(with(1, 5).doubt(rows(0, 4)), "") << "a picture too many";
  EXPECT_NE(with(1, 9).doubt({"5", "7"}), "")
      << "single labelled frames, and all pictures as ffmpeg numbers them";
  EXPECT_NE(with(100, 4).doubt(rows(0, 4)), "");
  EXPECT_NE(with(0, 4).doubt(rows(1, 4)), "");
}

TEST_F(Numbered, the_first_frame_shifts_the_count) {
  const NumberedPictures pictures = with(1, 3);
  EXPECT_EQ(pictures.name_of("0", 1), "f1.PNG");
  EXPECT_EQ(pictures.name_of("2", 1), "f3.PNG");
  EXPECT_EQ(pictures.name_of("3", 1), "3") << "there is no such picture";
  EXPECT_EQ(pictures.name_of("77", 0), "77") << "a table is no picture";
  write_text(folder() / "again2.jpg", "x");
  EXPECT_EQ(NumberedPictures(folder()).name_of("2", 0), "2") << "two pictures could be meant";
}

}  // namespace
}  // namespace q3d::loaders::formats
