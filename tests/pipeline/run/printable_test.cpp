#include "pipeline/run/printable.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::run {
namespace {

TEST(Printable, WritesControlCharactersOut) {
  EXPECT_EQ(printable_text("a\x1b[2Jb"), "a\\x1b[2Jb");
  EXPECT_EQ(printable_text(std::string("\0\a\x7f", 3)), "\\x00\\x07\\x7f");
  EXPECT_EQ(printable_text("a\rb"), "a\\rb");
}

TEST(Printable, KnowsTheControlCharactersBeyondAscii) {
  EXPECT_EQ(printable_text("a\xc2\x9b\x32Jb"), "a\\x9b2Jb");  // CSI, which begins a sequence like ESC [
  EXPECT_EQ(printable_text("\xc2"), "\xc2");
}

TEST(Printable, LeavesPlainTextAsItIs) {
  const std::string text = "Pferd_\xc3\xa4\xc2\xa0\xe7\x8b\xbc.jpg\n\tnext";
  EXPECT_EQ(printable_text(text), text);
}

TEST(Printable, ALineStaysOneLine) {
  EXPECT_EQ(printable_line("a\nquadruped3d: sound\tb\r"), "a\\nquadruped3d: sound\\tb\\r");
}

}  // namespace
}  // namespace q3d::pipeline::run
