#include "pipeline/run/command_line.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string_view>

namespace q3d::pipeline::run {
namespace {

// Returns the first word of this process's command line. quadruped3d-network keeps the word with which
// quadruped3d was started.
std::string started_as() {
  constexpr const char* kUsual = "quadruped3d";
  std::ifstream words("/proc/self/cmdline", std::ios::binary);
  std::string first;
  std::getline(words, first, '\0');
  return first.empty() ? kUsual : first;
}

}  // namespace

std::string shell_word(const std::string& word) {
  constexpr std::string_view kHarmless = "_./:,@%+-";
  const bool is_plain = !word.empty() && std::all_of(word.begin(), word.end(), [&](unsigned char c) {
    return std::isalnum(c) != 0 || kHarmless.find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (is_plain) return word;
  std::string quoted = "'";
  for (const char c : word) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

std::string command_line(const std::vector<std::string>& words) {
  std::string line = shell_word(started_as());
  for (const std::string& word : words) line += " " + shell_word(word);
  return line;
}

}  // namespace q3d::pipeline::run
