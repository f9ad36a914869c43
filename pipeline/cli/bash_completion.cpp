#include <fmt/format.h>
#include <fmt/ranges.h>

#include "pipeline/cli/completion.h"

namespace q3d::pipeline::cli {
namespace {

constexpr const char* kBeginning =
    R"(# bash completion of quadruped3d; `quadruped3d completion bash` makes this file.
_quadruped3d() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev= command= words= options= value= rest= i
  ((COMP_CWORD > 0)) && prev=${COMP_WORDS[COMP_CWORD - 1]}
  # bash parts "--option=value" at the sign.
  if [[ $cur == "=" ]]; then
    cur=
  elif [[ $prev == "=" ]]; then
    prev=${COMP_WORDS[COMP_CWORD - 2]}
  fi
  # The command that the words so far name, such as "build" or "config show".
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$command ${COMP_WORDS[i]}" in
)";

constexpr const char* kEnd = R"(  esac
  COMPREPLY=()
  # Where no option waits for its value, it is a command, an option, or what the command itself takes.
  if [[ -z $value ]]; then
    if [[ $cur == -* ]]; then
      value=words words=$options
    elif [[ -n $words ]]; then
      value=words
    else
      value=$rest
    fi
  fi
  case $value in
    words) mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur") ;;
    file) mapfile -t COMPREPLY < <(compgen -f -- "$cur") ;;
    folder) mapfile -t COMPREPLY < <(compgen -d -- "$cur") ;;
  esac
  # Outside of a completion there is nothing to set.
  [[ $value == file || $value == folder ]] && compopt -o filenames 2>/dev/null
  return 0
}
complete -F _quadruped3d quadruped3d
)";

std::string path_of(const CommandNode& node) {
  return fmt::format("{}", fmt::join(node.path, " "));
}

std::string names_of_options(const CommandNode& node) {
  std::string text;
  for (const OptionInfo& option : node.options) {
    text += fmt::format("{}{}", text.empty() ? "" : " ",
                        option.names.back());  // the long name if there are two
  }
  return text;
}

std::string names_of_commands(const CommandNode& node) {
  std::string text;
  for (const CommandNode& command : node.commands) {
    text += (text.empty() ? "" : " ") + command.name();
  }
  return text;
}

// Returns the script's name for a kind of value.
std::string name_of(ValueKind value) {
  switch (value) {
    case ValueKind::file:
      return "file";
    case ValueKind::folder:
      return "folder";
    case ValueKind::word:
      return "words";
    case ValueKind::none:
    case ValueKind::other:
      break;
  }
  return "other";
}

// Returns the cases for words that may stand where no option's value is expected.
std::string command_cases(const CommandNode& root, const std::vector<const CommandNode*>& nodes) {
  std::string text = "  case $command in\n";
  for (const CommandNode* node : nodes) {
    std::string words = names_of_commands(*node);
    if (node == &root) words += " help";
    std::string rest;
    for (const OptionInfo& positional : node->positionals) {
      for (const std::string& word : positional.words) words += (words.empty() ? "" : " ") + word;
      if (rest.empty()) rest = name_of(positional.value);
    }
    text += fmt::format("    \"{}\") words=\"{}\" options=\"{}\" rest={} ;;\n", path_of(*node), words,
                        names_of_options(*node), rest);
  }
  return text + fmt::format("    help) words=\"{}\" ;;\n  esac\n", names_of_commands(root));
}

// Returns the cases for values that may follow an option.
std::string value_cases(const std::vector<const CommandNode*>& nodes) {
  std::string text = "  case \"$command $prev\" in\n";
  for (const CommandNode* node : nodes) {
    for (const OptionInfo& option : node->options) {
      if (option.value == ValueKind::none) continue;
      std::string patterns;
      for (const std::string& name : option.names) {
        patterns += fmt::format("{}\"{} {}\"", patterns.empty() ? "" : " | ", path_of(*node), name);
      }
      std::string value = name_of(option.value);
      if (option.value == ValueKind::word)
        value += fmt::format(" words=\"{}\"", fmt::join(option.words, " "));
      text += fmt::format("    {}) value={} ;;\n", patterns, value);
    }
  }
  return text;
}

}  // namespace

std::string bash_completion(const CommandNode& root) {
  const std::vector<const CommandNode*> nodes = all_commands(root);
  std::string patterns;
  for (const CommandNode* node : nodes) {
    if (node == &root) continue;
    const std::vector<std::string> above(node->path.begin(), node->path.end() - 1);
    patterns += fmt::format("\"{} {}\" | ", fmt::join(above, " "), node->name());
  }
  std::string text = kBeginning;
  text += fmt::format("      {}\" help\") command=${{command:+$command }}${{COMP_WORDS[i]}} ;;\n", patterns);
  text += "    esac\n  done\n";
  return text + command_cases(root, nodes) + value_cases(nodes) + kEnd;
}

}  // namespace q3d::pipeline::cli
