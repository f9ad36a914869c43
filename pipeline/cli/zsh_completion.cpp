#include <fmt/format.h>
#include <fmt/ranges.h>

#include "pipeline/cli/completion.h"

namespace q3d::pipeline::cli {
namespace {

// Escapes a text for zsh's single quotes, with a backslash before the characters that _arguments and
// _describe interpret.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char sign : text) {
    if (sign == '\'') {
      result += "'\\''";
    } else if (sign == '\n') {
      result += ' ';
    } else {
      if (sign == '[' || sign == ']' || sign == ':' || sign == '\\') result += '\\';
      result += sign;
    }
  }
  return result;
}

std::string function_of(const CommandNode& node) {
  return node.path.empty() ? "_quadruped3d" : fmt::format("_quadruped3d_{}", fmt::join(node.path, "_"));
}

std::string action_of(const OptionInfo& option) {
  switch (option.value) {
    case ValueKind::file:
      return "_files";
    case ValueKind::folder:
      return "_files -/";
    case ValueKind::word:
      return fmt::format("({})", fmt::join(option.words, " "));
    case ValueKind::none:
    case ValueKind::other:
      break;
  }
  return " ";
}

// Returns the specification of an option for _arguments, once for each of its names.
std::string option_specs(const OptionInfo& option) {
  std::string text;
  for (const std::string& name : option.names) {
    const bool is_long = name.rfind("--", 0) == 0;
    const bool takes_value = option.value != ValueKind::none;
    const std::string alone =
        option.repeats ? "*" : fmt::format("({})", fmt::join(option.names, " "));  // these exclude each other
    text +=
        fmt::format("    '{}{}{}[{}]{}'\n", alone, name, takes_value ? (is_long ? "=" : "+") : "",
                    escaped(option.description),
                    takes_value ? fmt::format(":{}:{}", escaped(option.value_name), action_of(option)) : "");
  }
  return text;
}

std::string specs(const CommandNode& node) {
  std::string text;
  for (const OptionInfo& option : node.options) text += option_specs(option);
  for (const OptionInfo& positional : node.positionals) {
    text += fmt::format("    '{}:{}:{}'\n", positional.repeats ? "*" : "", escaped(positional.names.front()),
                        action_of(positional));
  }
  return text;
}

// Returns a function for a command without commands of its own.
std::string leaf(const CommandNode& node) {
  return fmt::format("{}() {{\n  local -a specs=(\n{}  )\n  _arguments -s $specs\n}}\n", function_of(node),
                     specs(node));
}

std::string branch(const CommandNode& node) {
  std::string names;
  std::string cases;
  for (const CommandNode& command : node.commands) {
    names += fmt::format("        '{}:{}'\n", command.name(), escaped(command.description));
    cases += fmt::format("        {}) {} ;;\n", command.name(), function_of(command));
  }
  if (node.path.empty()) {
    names += "        'help:explain a command with examples'\n";
    cases += fmt::format("        help) _values command {} ;;\n", [&] {
      std::string list;
      for (const CommandNode& command : node.commands) list += (list.empty() ? "" : " ") + command.name();
      return list;
    }());
  }
  return fmt::format(
      "{}() {{\n"
      "  local curcontext=$curcontext state line\n"
      "  local -a specs=(\n{}    '1: :->command'\n    '*:: :->rest'\n  )\n"
      "  _arguments -C -s $specs\n"
      "  case $state in\n"
      "    command)\n"
      "      local -a commands=(\n{}      )\n"
      "      _describe command commands\n"
      "      ;;\n"
      "    rest)\n"
      "      case $line[1] in\n{}      esac\n"
      "      ;;\n"
      "  esac\n}}\n",
      function_of(node), specs(node), names, cases);
}

}  // namespace

std::string zsh_completion(const CommandNode& root) {
  std::string text =
      "#compdef quadruped3d\n# zsh completion of quadruped3d; `quadruped3d completion zsh` makes this "
      "file.\n";
  for (const CommandNode* node : all_commands(root))
    text += node->commands.empty() ? leaf(*node) : branch(*node);
  return text +
         "# zsh calls a file of $fpath as the function of its name; a file that is sourced names its "
         "function.\n"
         "if [[ $funcstack[1] == _quadruped3d ]]; then\n"
         "  _quadruped3d \"$@\"\n"
         "else\n"
         "  compdef _quadruped3d quadruped3d\n"
         "fi\n";
}

}  // namespace q3d::pipeline::cli
