#include "pipeline/cli/usage.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "manifests/spelling.h"
#include "pipeline/cli/commands.h"

namespace q3d::pipeline::cli {
namespace {

bool is_option(std::string_view word) {
  return word.size() > 1 && word.front() == '-';
}

// The innermost command that was recognised, with its full name: "quadruped3d config show".
struct Recognised {
  const CLI::App* app;
  std::string name;
};

Recognised innermost(const CLI::App& app) {
  Recognised found{&app, app.get_name()};
  while (true) {
    const std::vector<CLI::App*> chosen = found.app->get_subcommands();
    if (chosen.empty()) return found;
    found = {chosen.front(), found.name + " " + chosen.front()->get_name()};
  }
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

std::vector<std::string> subcommand_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return names;
}

// Returns the option without an attached value: "--confg=my.json" -> "--confg".
std::string option_name(const std::string& word) {
  return word.substr(0, word.find('='));
}

// Returns a text that names the words that were not understood; empty if there are none.
std::string unknown_words(const CLI::App& app) {
  const std::vector<std::string> words = app.remaining();
  const std::vector<std::string> commands = subcommand_names(app);
  std::string text;
  for (const std::string& word : words) {
    if (!is_option(word)) continue;
    const std::string name = option_name(word);
    text += fmt::format("{}unknown option \"{}\"{}", text.empty() ? "" : " ", name,
                        manifests::suggestion(name, option_names(app)));
  }
  if (text.empty() && !words.empty()) {
    const bool is_command = !commands.empty();
    text = fmt::format("{} \"{}\"{}", is_command ? "unknown command" : "unexpected word", words.front(),
                       is_command ? manifests::suggestion(words.front(), commands) : "");
  }
  return text;
}

}  // namespace

std::vector<std::string> with_help_expanded(std::vector<std::string> words) {
  if (words.size() < 2 || words[1] != "help") return words;
  words.erase(words.begin() + 1);
  words.emplace_back("--help");
  return words;
}

std::optional<std::string> unknown_command(const std::vector<std::string>& words) {
  if (words.size() < 2 || is_option(words[1])) return std::nullopt;
  std::vector<std::string> names;
  for (const CommandInfo& command : kCommands) names.emplace_back(command.name);
  if (std::find(names.begin(), names.end(), words[1]) != names.end()) return std::nullopt;
  return fmt::format(
      "quadruped3d: unknown command \"{}\"{}\nThe commands are {}.\n`quadruped3d help COMMAND` explains "
      "one.\n",
      words[1], manifests::suggestion(words[1], names), fmt::join(names, ", "));
}

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const Recognised command = innermost(app);
  std::string what = unknown_words(*command.app);
  if (what.empty()) what = error.what();
  std::string text = fmt::format("{}: {}\n", command.name, what);
  const std::vector<std::string> commands = subcommand_names(*command.app);
  if (!commands.empty()) text += fmt::format("The commands are {}.\n", fmt::join(commands, ", "));
  text += fmt::format("The options are {}.\n", fmt::join(option_names(*command.app), ", "));
  return text + (command.app == &app
                     ? "`quadruped3d help COMMAND` explains a command.\n"
                     : fmt::format("`{} --help` explains them with examples.\n", command.name));
}

}  // namespace q3d::pipeline::cli
