// The commands of the program with their options, as they are declared to CLI11. Completions and the manual
// page are made from it, so they cannot differ from what the program accepts.
#pragma once

#include <CLI/App.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace q3d::pipeline::cli {

enum class ValueKind : std::uint8_t { none, file, folder, word, other };

struct OptionInfo {
  std::vector<std::string> names;  // "-c", "--config"; a positional argument has one name
  std::string description;
  ValueKind value = ValueKind::none;
  std::string value_name;          // "FILE", "INT"; empty without a value
  std::vector<std::string> words;  // allowed values, for ValueKind::word
  std::string default_value;
  bool is_required = false;
  bool repeats = false;  // it may be given several times, or takes several values
};

struct CommandNode {
  std::vector<std::string> path;  // its name after those of the commands above it; empty for the program
  std::string description;
  std::string footer;  // examples and remarks
  std::vector<OptionInfo> options;
  std::vector<OptionInfo> positionals;
  std::vector<CommandNode> commands;

  std::string name() const { return path.empty() ? std::string() : path.back(); }
};

CommandNode command_tree(const CLI::App& app);

// Returns the node and all nodes below it, each command before its own commands.
std::vector<const CommandNode*> all_commands(const CommandNode& root);

}  // namespace q3d::pipeline::cli
