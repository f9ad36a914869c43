// Formats command lines that a user can paste into a shell.
#pragma once

#include <string>
#include <vector>

namespace q3d::pipeline::run {

// Returns the word as a POSIX shell takes it: in single quotes if it holds anything but letters, digits and
// harmless signs.
std::string shell_word(const std::string& word);

// Returns "PROGRAM WORD WORD ..." with every word as a shell takes it. PROGRAM is the name by which this
// program was started, so that the line also works where quadruped3d is not on the PATH.
std::string command_line(const std::vector<std::string>& words);

}  // namespace q3d::pipeline::run
