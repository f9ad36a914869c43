// Makes scripts with which a shell completes the program's commands, options and values.
#pragma once

#include <string>

#include "pipeline/cli/command_tree.h"

namespace q3d::pipeline::cli {

// Each function returns a whole script for the program `quadruped3d`, however it is started.
std::string bash_completion(const CommandNode& root);
std::string zsh_completion(const CommandNode& root);  // a file _quadruped3d in $fpath, or sourced
std::string fish_completion(const CommandNode& root);

}  // namespace q3d::pipeline::cli
