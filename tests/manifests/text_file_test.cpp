#include "manifests/text_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

using namespace std::string_view_literals;
using ::testing::HasSubstr;

class TextFile : public ::testing::Test {
 protected:
  std::string read(std::string_view content) const {
    std::ofstream(file(), std::ios::binary) << content;
    return read_text_file(file(), "a table");
  }
  std::string refusal(std::string_view content) const {
    try {
      read(content);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  std::filesystem::path file() const { return scratch_.path() / "labels.csv"; }

 private:
  q3d::testing::ScratchDir scratch_;
};

TEST_F(TextFile, a_byte_order_mark_is_dropped) {
  EXPECT_EQ(read("a,b\n"), "a,b\n");
  EXPECT_EQ(read("\xef\xbb\xbf"
                 "a,b\n"),
            "a,b\n");
}

// "a", "é" (U+00E9), "中" (U+4E2D) and "🐕" (U+1F415, a pair of two units), in both byte orders.
TEST_F(TextFile, utf16_is_converted) {
  const std::string expected = "a\u00e9\u4e2d\U0001f415";
  EXPECT_EQ(read("\xff\xfe"
                 "a\0\xe9\0\x2d\x4e\x3d\xd8\x15\xdc"sv),
            expected);
  EXPECT_EQ(read("\xfe\xff"
                 "\0a\0\xe9\x4e\x2d\xd8\x3d\xdc\x15"sv),
            expected);
  EXPECT_EQ(read("\xff\xfe"
                 "\x3d\xd8"
                 "a\0"sv),
            "\ufffda")
      << "half of a pair";
  EXPECT_THAT(refusal("{\0\"\0a\0"sv), HasSubstr("encoding UTF-8"));
}

TEST_F(TextFile, names_what_is_not_the_file_itself) {
  struct Other {
    std::string_view content;
    const char* says;
  };
  for (const Other& each :
       {Other{"", "got an empty file (0 bytes)"}, Other{" \r\n", "without any text"},
        Other{"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "`git lfs pull`"},
        Other{"\n<!DOCTYPE html><html>", "an HTML page"}, Other{"<HTML>", "an HTML page"},
        Other{"<?xml version=\"1.0\"?><annotations>", "CVAT"},
        Other{"<?xml version=\"1.0\"?><a>", "an XML file"}, Other{"<annotation><folder>", "Pascal VOC"},
        Other{"PK\3\4...", "a ZIP archive"}, Other{"\x1f\x8b...", "a gzip archive"},
        Other{"\x80\x04...", "a Python pickle"}, Other{"\x89HDF\r\n\x1a\n", "an HDF5 file"}}) {
    const std::string said = refusal(each.content);
    EXPECT_THAT(said, HasSubstr(each.says));
    EXPECT_THAT(said, HasSubstr("labels.csv: got "));
    EXPECT_THAT(said, HasSubstr("expected a table"));
  }
}

}  // namespace
}  // namespace q3d::manifests
