#include "pipeline/run/command_line.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>

namespace q3d::pipeline::run {
namespace {

// Returns what a shell makes of the word.
std::string as_a_shell_reads(const std::string& word) {
  std::FILE* shell = popen(("printf %s " + shell_word(word)).c_str(), "r");
  std::array<char, 256> text{};
  const std::size_t bytes = std::fread(text.data(), 1, text.size(), shell);
  pclose(shell);
  return {text.data(), bytes};
}

TEST(ShellWord, IsReadBackByAShell) {
  for (const char* word :
       {"out/latest", "a/img.png#12", "my out", "it's", "$HOME", "a\"b", "*", "a&b", "~", "é ü"}) {
    EXPECT_EQ(as_a_shell_reads(word), word);
  }
  EXPECT_EQ(shell_word("out/a-1_2.h5"), "out/a-1_2.h5");  // plain words stay readable
  EXPECT_EQ(shell_word(""), "''");
}

TEST(CommandLine, StartsWithTheProgramAsItWasStarted) {
  const std::string line = command_line({"verify", "my out"});
  EXPECT_NE(line.find("run_test"), std::string::npos) << line;
  EXPECT_TRUE(line.ends_with(" verify 'my out'")) << line;
}

}  // namespace
}  // namespace q3d::pipeline::run
