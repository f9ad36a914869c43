// The manual page of the program.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/cli/command_tree.h"

namespace q3d::pipeline::cli {

// Returns quadruped3d(1) in the macros of man(7). It bears no date, so the same program gives the same page.
std::string man_page(const CommandNode& root, std::string_view version);

}  // namespace q3d::pipeline::cli
