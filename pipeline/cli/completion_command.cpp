#include <fmt/format.h>

#include <memory>

#include "pipeline/cli/command_tree.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/completion.h"
#include "pipeline/cli/man_page.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::cli {

Command add_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = declare(app, "completion");
  command->add_option("shell", *shell, "the shell: bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->footer(
      "Examples:\n"
      "  quadruped3d completion bash > ~/.local/share/bash-completion/completions/quadruped3d\n"
      "  quadruped3d completion zsh > ~/.zfunc/_quadruped3d          with ~/.zfunc in $fpath, before "
      "compinit\n"
      "  quadruped3d completion fish > ~/.config/fish/completions/quadruped3d.fish\n"
      "`cmake --install` puts the three scripts and the manual page below share/ of its prefix.");
  return [&app, shell] {
    const CommandNode root = command_tree(app);
    fmt::print("{}", *shell == "bash"  ? bash_completion(root)
                     : *shell == "zsh" ? zsh_completion(root)
                                       : fish_completion(root));
    return 0;
  };
}

Command add_man(CLI::App& app) {
  CLI::App* command = declare(app, "man");
  command->footer(
      "Examples:\n"
      "  quadruped3d man | man -l -\n"
      "  quadruped3d man > quadruped3d.1");
  return [&app] {
    fmt::print("{}", man_page(command_tree(app), run::version()));
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
