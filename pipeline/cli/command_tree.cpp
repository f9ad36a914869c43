#include "pipeline/cli/command_tree.h"

#include <algorithm>
#include <sstream>

namespace q3d::pipeline::cli {
namespace {

// CLI11 writes what an option accepts behind its type: "TEXT:FILE", "TEXT:{build,training}", "INT:INT in [1 -
// 60]".
struct TypeText {
  std::string type;
  std::string check;
};

TypeText type_text(const CLI::Option& option) {
  const std::string whole = option.get_type_name();
  const std::size_t colon = whole.find(':');
  if (colon == std::string::npos) return {whole, {}};
  return {whole.substr(0, colon), whole.substr(colon + 1)};
}

std::vector<std::string> words_of(const std::string& check) {
  std::vector<std::string> words;
  if (check.size() < 2 || check.front() != '{' || check.back() != '}') return words;
  std::istringstream text(check.substr(1, check.size() - 2));
  for (std::string word; std::getline(text, word, ',');) words.push_back(word);
  return words;
}

void set_value(const CLI::Option& option, OptionInfo& info) {
  if (option.get_items_expected_max() == 0) return;  // a flag
  const TypeText text = type_text(option);
  info.value_name = text.type;
  info.value = ValueKind::other;
  info.words = words_of(text.check);
  if (!info.words.empty()) {
    info.value = ValueKind::word;
  } else if (text.check == "DIR" || text.type == "FOLDER") {
    info.value = ValueKind::folder;
    info.value_name = "FOLDER";
  } else if (text.check == "FILE" || text.type == "FILE" || text.check.rfind("PATH", 0) == 0) {
    info.value = ValueKind::file;
    info.value_name = text.check.rfind("PATH", 0) == 0 ? "PATH" : "FILE";
  } else if (text.type == "TEXT" && text.check.empty()) {
    info.value = ValueKind::file;  // most texts without a check are paths that need not exist yet
  }
}

OptionInfo option_info(const CLI::Option& option) {
  OptionInfo info;
  if (option.get_positional()) {
    info.names.push_back(option.get_name(/*positional=*/true));
  } else {
    for (const std::string& name : option.get_snames()) info.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) info.names.push_back("--" + name);
  }
  info.description = option.get_description();
  info.default_value = option.get_default_str();
  info.is_required = option.get_required();
  info.repeats = option.get_items_expected_max() > 1;
  set_value(option, info);
  return info;
}

CommandNode node_of(const CLI::App& app, std::vector<std::string> path) {
  CommandNode node;
  node.path = std::move(path);
  node.description = app.get_description();
  node.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options()) {
    (option->get_positional() ? node.positionals : node.options).push_back(option_info(*option));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    std::vector<std::string> below = node.path;
    below.push_back(command->get_name());
    node.commands.push_back(node_of(*command, std::move(below)));
  }
  return node;
}

void collect(const CommandNode& node, std::vector<const CommandNode*>& list) {
  list.push_back(&node);
  for (const CommandNode& command : node.commands) collect(command, list);
}

}  // namespace

CommandNode command_tree(const CLI::App& app) {
  return node_of(app, {});
}

std::vector<const CommandNode*> all_commands(const CommandNode& root) {
  std::vector<const CommandNode*> list;
  collect(root, list);
  return list;
}

}  // namespace q3d::pipeline::cli
