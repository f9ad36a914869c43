#include "pipeline/cli/man_page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <sstream>

namespace q3d::pipeline::cli {
namespace {

// Escapes a text so that troff prints it unchanged. Lines that begin with a dot or a quote would be requests.
std::string escaped(const std::string& text) {
  std::string result;
  bool is_at_start = true;
  for (const char sign : text) {
    if (is_at_start && (sign == '.' || sign == '\'')) result += "\\&";
    if (sign == '\\') {
      result += "\\e";
    } else if (sign == '-') {
      result += "\\-";
    } else if (sign == '\'') {
      result += "\\(aq";
    } else if (sign == '`') {
      result += "\\(ga";
    } else {
      result += sign;
    }
    is_at_start = sign == '\n';
  }
  return result;
}

std::string verbatim(const std::string& text) {
  return ".PP\n.nf\n" + escaped(text) + "\n.fi\n";
}

std::string value_of(const OptionInfo& option) {
  if (option.value == ValueKind::none) return {};
  const std::string value =
      option.words.empty() ? option.value_name : fmt::format("{}", fmt::join(option.words, "|"));
  return value + (option.repeats ? " ..." : "");
}

// Returns the synopsis, such as "[--out TEXT]". Required options have no brackets.
std::string synopsis_of(const CommandNode& node) {
  std::string text = fmt::format("quadruped3d {}", fmt::join(node.path, " "));
  for (const OptionInfo& positional : node.positionals) {
    const std::string value = positional.names.front() + (positional.repeats ? " ..." : "");
    text += positional.is_required ? " " + value : " [" + value + "]";
  }
  for (const OptionInfo& option : node.options) {
    if (option.is_required) text += fmt::format(" {} {}", option.names.back(), value_of(option));
  }
  if (!node.commands.empty()) text += " COMMAND";
  return text + " [OPTIONS]";
}

std::string option_entry(const OptionInfo& option, bool is_positional) {
  std::string head = fmt::format("{}", fmt::join(option.names, ", "));
  if (const std::string value = value_of(option); !value.empty() && !is_positional) head += " " + value;
  std::string text = ".TP\n.B " + escaped(head) + "\n" + escaped(option.description);
  if (option.is_required) text += " (required)";
  if (!option.default_value.empty()) text += escaped(fmt::format(" (default: {})", option.default_value));
  return text + "\n";
}

std::string entries(const CommandNode& node) {
  std::string text;
  for (const OptionInfo& positional : node.positionals) text += option_entry(positional, true);
  for (const OptionInfo& option : node.options) text += option_entry(option, false);
  return text;
}

std::string command_section(const CommandNode& node) {
  std::string text = fmt::format(".SS {}\n", escaped(fmt::format("{}", fmt::join(node.path, " "))));
  text += escaped(node.description) + ".\n";
  text += verbatim(synopsis_of(node)) + entries(node);
  return node.footer.empty() ? text : text + verbatim(node.footer);
}

}  // namespace

std::string man_page(const CommandNode& root, std::string_view version) {
  std::string text = fmt::format(
      ".\\\" `quadruped3d man` makes this page.\n"
      ".TH QUADRUPED3D 1 \"\" \"quadruped3d {}\" \"User Commands\"\n"
      ".SH NAME\nquadruped3d \\- 3D datasets of quadrupeds from photographs with 2D keypoints\n"
      ".SH SYNOPSIS\n.B quadruped3d\n.I COMMAND\n[OPTIONS]\n",
      version);
  text += ".SH DESCRIPTION\n" + escaped(root.description) + "\n" + verbatim(root.footer);
  text += ".SH OPTIONS\n" + entries(root);
  text += ".SH COMMANDS\n";
  for (const CommandNode* node : all_commands(root)) {
    if (node != &root) text += command_section(*node);
  }
  return text +
         ".SH EXIT STATUS\n"
         ".TP\n.B 0\nThe command is done.\n"
         ".TP\n.B 1\nSomething went wrong while the program ran; for verify: the dataset has problems.\n"
         ".TP\n.B 2\nThe usage is wrong, or the config cannot be used.\n"
         ".TP\n.B 130, 143, 129\nThe program was stopped by Ctrl\\-C, SIGTERM or SIGHUP; the same command "
         "goes on.\n"
         ".SH ENVIRONMENT\n"
         ".TP\n.B NO_COLOR\nProgress has no colours if this variable is set to anything.\n"
         ".TP\n.B OMP_WAIT_POLICY, GOMP_SPINCOUNT\n"
         "How the threads of the network wait; they wait passively unless one of the two is set.\n";
}

}  // namespace q3d::pipeline::cli
