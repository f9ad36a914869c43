#include "manifests/valid_utf8.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace q3d::manifests {
namespace {

TEST(ValidUtf8, LeavesCharactersOfEveryLengthAlone) {
  for (const std::string text :
       {"", "a\\xe9", "\u00fc\u07ff", "\u0800\ud7ff\ue000\uffff", "\U00010000\U0010ffff"}) {
    EXPECT_EQ(valid_utf8(text), text);
  }
}

TEST(ValidUtf8, WritesOtherBytesOut) {
  EXPECT_EQ(valid_utf8("caf\xe9.png"), "caf\\xe9.png") << "Latin-1";
  EXPECT_EQ(valid_utf8("\xc3"), "\\xc3") << "a character that is cut off";
  EXPECT_EQ(valid_utf8("\xe4\xbd/"), "\\xe4\\xbd/");
  EXPECT_EQ(valid_utf8("\x80z\xff"), "\\x80z\\xff");
  EXPECT_EQ(valid_utf8("\xc0\xaf"), "\\xc0\\xaf") << "'/' in two bytes";
  EXPECT_EQ(valid_utf8("\xe0\x80\xaf"), "\\xe0\\x80\\xaf");
  EXPECT_EQ(valid_utf8("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "half of a UTF-16 pair";
  EXPECT_EQ(valid_utf8("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "above U+10FFFF";
}

// Whatever the bytes are, JSON takes the text.
TEST(ValidUtf8, IsWhatJsonAccepts) {
  for (int first = 0; first < 256; ++first) {
    for (int second = 0; second < 256; ++second) {
      const std::string text{static_cast<char>(first), static_cast<char>(second), '\x80', '\x80', 'a'};
      EXPECT_NO_THROW(nlohmann::json(valid_utf8(text)).dump()) << first << " " << second;
    }
  }
}

}  // namespace
}  // namespace q3d::manifests
