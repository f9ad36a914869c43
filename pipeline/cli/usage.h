// Makes the messages about a command line that cannot be used.
#pragma once

#include <CLI/App.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::cli {

// Turns `help COMMAND ...` into `COMMAND ... --help` and `help` alone into `--help`. Everything else stays as
// it is. The first word is the program's name.
std::vector<std::string> with_help_expanded(std::vector<std::string> words);

// Returns a message if the first word after the program's name is neither an option nor a command of
// kCommands. It names the nearest command and lists all of them.
std::optional<std::string> unknown_command(const std::vector<std::string>& words);

// Explains why `app` could not parse its command line. It names unknown options and words, each with the
// nearest known one, and lists all that exist.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

}  // namespace q3d::pipeline::cli
