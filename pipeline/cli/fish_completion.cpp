#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "pipeline/cli/completion.h"

namespace q3d::pipeline::cli {
namespace {

// Returns the text in fish's single quotes.
std::string in_quotes(const std::string& text) {
  std::string result = "'";
  for (const char sign : text) {
    if (sign == '\'' || sign == '\\') result += '\\';
    result += sign == '\n' ? ' ' : sign;
  }
  return result + "'";
}

std::string names_of(const std::vector<CommandNode>& commands) {
  std::string text;
  for (const CommandNode& command : commands) text += (text.empty() ? "" : " ") + command.name();
  return text;
}

// Returns fish code that tests whether the words so far name this command.
std::string condition(const CommandNode& node) {
  if (node.path.empty()) return "__fish_use_subcommand";
  std::string text;
  for (const std::string& name : node.path) {
    text += fmt::format("{}__fish_seen_subcommand_from {}", text.empty() ? "" : "; and ", name);
  }
  return text;
}

std::string option_line(const CommandNode& node, const OptionInfo& option) {
  std::string text = "complete -c quadruped3d -n " + in_quotes(condition(node));
  for (const std::string& name : option.names) {
    const bool is_long = name.rfind("--", 0) == 0;
    text += is_long ? " -l " + name.substr(2) : " -s " + name.substr(1);
  }
  switch (option.value) {
    case ValueKind::none:
      break;
    case ValueKind::file:
      text += " -r -F";
      break;
    case ValueKind::folder:
      text += " -x -a '(__fish_complete_directories)'";
      break;
    case ValueKind::word:
      text += fmt::format(" -x -a '{}'", fmt::join(option.words, " "));
      break;
    case ValueKind::other:
      text += " -x";
      break;
  }
  return text + " -d " + in_quotes(option.description) + "\n";
}

std::string positional_line(const CommandNode& node, const OptionInfo& positional) {
  const std::string beginning = "complete -c quadruped3d -n " + in_quotes(condition(node));
  if (positional.value == ValueKind::word) {
    return beginning + fmt::format(" -a '{}'\n", fmt::join(positional.words, " "));
  }
  if (positional.value == ValueKind::folder) return beginning + " -a '(__fish_complete_directories)'\n";
  return positional.value == ValueKind::file ? beginning + " -F\n" : std::string();
}

std::string lines_of(const CommandNode& node) {
  std::string text;
  std::string where = condition(node);
  if (!node.path.empty() && !node.commands.empty()) {
    where += fmt::format("; and not __fish_seen_subcommand_from {}", names_of(node.commands));
  }
  for (const CommandNode& command : node.commands) {
    text += fmt::format("complete -c quadruped3d -n {} -a {} -d {}\n", in_quotes(where), command.name(),
                        in_quotes(command.description));
  }
  for (const OptionInfo& option : node.options) text += option_line(node, option);
  for (const OptionInfo& positional : node.positionals) text += positional_line(node, positional);
  return text;
}

}  // namespace

std::string fish_completion(const CommandNode& root) {
  std::string text =
      "# fish completion of quadruped3d; `quadruped3d completion fish` makes this file.\n"
      "complete -c quadruped3d -f\n";
  for (const CommandNode* node : all_commands(root)) text += lines_of(*node);
  return text +
         fmt::format(
             "complete -c quadruped3d -n __fish_use_subcommand -a help -d 'explain a command with examples'\n"
             "complete -c quadruped3d -n '__fish_seen_subcommand_from help' -a '{}'\n",
             names_of(root.commands));
}

}  // namespace q3d::pipeline::cli
