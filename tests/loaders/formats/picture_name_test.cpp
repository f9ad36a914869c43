#include "loaders/formats/picture_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loaders/formats/folded_name.h"

namespace q3d::loaders::formats {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;

// Relative readings as they are, absolute ones with a '/' in front.
std::vector<std::string> readings(std::string_view name) {
  std::vector<std::string> texts;
  for (const NameReading& reading : readings_of(name)) {
    texts.push_back((reading.is_absolute ? "/" : "") + reading.path.string());
  }
  return texts;
}

TEST(PictureName, a_posix_path_has_one_reading) {
  EXPECT_THAT(readings("images/a.jpg"), ElementsAre("images/a.jpg"));
  EXPECT_THAT(readings("./images//b/../a.jpg"), ElementsAre("images/a.jpg"));
  EXPECT_THAT(readings("/data/images/a.jpg"), ElementsAre("/data/images/a.jpg"));
  EXPECT_TRUE(readings_of("/data/a.jpg")[0].is_posix_absolute);
  EXPECT_FALSE(readings_of("C:/data/a.jpg").back().is_posix_absolute);
  EXPECT_THAT(readings("what?.jpg"), ElementsAre("what?.jpg"));
  EXPECT_THAT(readings("100%.jpg"), ElementsAre("100%.jpg"));
}

TEST(PictureName, windows_names) {
  EXPECT_THAT(readings("images\\a.jpg"), ElementsAre("images\\a.jpg", "images/a.jpg"));
  EXPECT_THAT(readings("..\\images\\a.jpg"), Contains("../images/a.jpg"));
  EXPECT_THAT(readings("D:\\set\\a.jpg"), Contains("/set/a.jpg"));
  EXPECT_THAT(readings("d:/set/a.jpg"), Contains("/set/a.jpg"));
  EXPECT_THAT(readings("\\\\server\\share\\set\\a.jpg"), Contains("/set/a.jpg"));
  EXPECT_THAT(readings("\\\\?\\D:\\set\\a.jpg"), Contains("/set/a.jpg"));
}

TEST(PictureName, urls) {
  EXPECT_THAT(readings("https://host.org/set/a.jpg?size=9#part"), Contains("/set/a.jpg"));
  EXPECT_THAT(readings("gs://bucket/set/a.jpg"), Contains("/set/a.jpg"));
  EXPECT_THAT(readings("file:///C:/set/a.jpg"), Contains("/set/a.jpg"));
  EXPECT_THAT(readings("file:/home/a.jpg"), Contains("/home/a.jpg"));
  EXPECT_THAT(readings("https://host.org/set/two%20words.jpg"), Contains("/set/two words.jpg"));
  EXPECT_THAT(readings("/data/local-files/?d=set%2Fa.jpg"), Contains("/set/a.jpg"));
}

TEST(PictureName, percent_codes) {
  EXPECT_THAT(readings("two%20words.jpg"), ElementsAre("two%20words.jpg", "two words.jpg"));
  EXPECT_THAT(readings("sub%2Fa.jpg"), Contains("sub/a.jpg"));
  EXPECT_THAT(readings("sub%5Ca.jpg"), Contains("sub/a.jpg"));
  EXPECT_THAT(readings("%2e%2e/a.jpg"), Contains("../a.jpg"));
  EXPECT_THAT(readings("a%00.jpg"), ElementsAre("a%00.jpg"));
  EXPECT_THAT(readings("a%4"), ElementsAre("a%4"));
}

TEST(PictureName, spaces_around_a_name) {
  EXPECT_THAT(readings(" sub/a.jpg\r\n"), ElementsAre(" sub/a.jpg\r\n", "sub/a.jpg"));
  EXPECT_THAT(readings("D:\\set\\a.jpg "), Contains("/set/a.jpg"));
  EXPECT_THAT(readings(" "), ElementsAre(" "));
}

TEST(PictureName, in_a_sample_id) {
  EXPECT_EQ(id_part("images/./a.jpg"), "images/a.jpg");
  EXPECT_EQ(id_part("images\\a.jpg"), "images/a.jpg");
  EXPECT_EQ(id_part("D:\\set\\images\\a.jpg"), "a.jpg");
  EXPECT_EQ(id_part("/set/images/a.jpg"), "a.jpg");
  EXPECT_EQ(id_part("https://host.org/set/a.jpg?size=9"), "a.jpg");
  EXPECT_EQ(id_part("../set/a.jpg"), "a.jpg");
  EXPECT_EQ(id_part("two%20words.jpg"), "two%20words.jpg");
  EXPECT_EQ(id_part("line\nbreak.jpg"), "line_break.jpg");
}

TEST(FoldedName, is_equal_for_what_people_call_the_same) {
  EXPECT_EQ(folded_name("IMG+1.JPEG"), folded_name("img 1.jpg"));
  EXPECT_EQ(folded_name("H\u00fcndin.png"), folded_name("Hu\u0308ndin.PNG"));
  EXPECT_EQ(folded_name("\u1112\u1161\u11ab.png"), folded_name("\ud55c.png")) << "Hangul";
  EXPECT_EQ(folded_name("\u00c5.png"), folded_name("a\u030a.png"));
  EXPECT_NE(folded_name("Hundin.png"), folded_name("H\u00fcndin.png"));
  EXPECT_NE(folded_name("a.png"), folded_name("a.jpg"));
  EXPECT_EQ(folded_name("Caf\xe9.PNG"), "caf\xe9.png") << "Latin-1, which is no UTF-8";
}

}  // namespace
}  // namespace q3d::loaders::formats
