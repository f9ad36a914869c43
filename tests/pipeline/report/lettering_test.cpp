#include "pipeline/report/lettering.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::report {
namespace {

TEST(Wrapped, KeepsEveryCharacterAndTheWidth) {
  const std::string id = "superanimal/train/a_very_long_folder_name/another_folder/picture_000123.jpg#4711";
  std::string joined;
  for (const std::string& line : wrapped(id, 150, TextSize::small)) {
    EXPECT_LE(text_width_px(line, TextSize::small), 150) << line;
    joined += line;
  }
  EXPECT_EQ(joined, id);
}

TEST(Wrapped, BreaksAtSpaces) {
  const int width = text_width_px("one two", TextSize::normal);
  EXPECT_EQ(wrapped("one two six", width, TextSize::normal), (std::vector<std::string>{"one two", "six"}));
  EXPECT_TRUE(wrapped("", 100, TextSize::normal).empty());
}

TEST(Write, ShowsOneMarkForACharacterThatTheFontLacks) {
  EXPECT_EQ(text_width_px("L\xC3\xB6we", TextSize::normal), text_width_px("L?we", TextSize::normal));
}

}  // namespace
}  // namespace q3d::pipeline::report
