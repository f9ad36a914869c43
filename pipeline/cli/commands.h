// The subcommands of `quadruped3d`. Each add_* declares one on the application and returns what runs it.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace q3d::pipeline::cli {

// A command without --ranks has none. The ranks of others either share units, so that a lost rank's units are
// made by the others, or take every step together, so that all are needed to the end.
enum class RankWork : std::uint8_t { none, units, steps };

struct CommandInfo {
  std::string_view name;
  std::string_view description;  // one line of `quadruped3d --help`
  bool needs_network;            // runs in quadruped3d-network, which links LibTorch and has all commands
  std::string_view network_option{};  // with this option, the command runs there too
  RankWork rank_work = RankWork::none;
};
inline constexpr std::array<CommandInfo, 27> kCommands{{
    {"build", "make a versioned dataset of labels from annotated photographs", true, {}, RankWork::units},
    {"calibrate", "find the thresholds that give the wanted shares of labels", true, {}, RankWork::units},
    {"predict", "give the bodies of animals in photographs, with or without keypoints", true},
    {"verify", "read a whole dataset and check every byte of it", false, "--repair"},
    {"status", "list the builds of an output folder, and how far each of their stages has come", false},
    {"inspect", "show what a dataset or a shard contains, as text or as a picture", false, "--sheet"},
    {"overlay", "draw predictions and labels as meshes over their photographs, or write them as 3D files",
     true},
    {"report", "write a page that shows a whole dataset, and its numbers as JSON", true},
    {"sample", "render pictures of quadrupeds with known 3D truth, in the layouts of public datasets", true},
    {"init", "write an untrained checkpoint, or the synthetic body model and its priors", true},
    {"train", "train a network from shards", true, {}, RankWork::steps},
    {"evaluate", "measure a network on test sets with the paper's metrics", true, {}, RankWork::units},
    {"compare", "test whether one network is better than another on the same pictures", true},
    {"evaluate-labels", "measure how close the labels of a build are to known truth", true},
    {"compare-labels", "test which of two builds' rules keep the more accurate labels, at equal yield", true},
    {"config", "show a whole config, with all defaults", false},
    {"explain", "show all that is known of one candidate, and why it got its verdict", false},
    {"leakage", "find pictures of the pool that are also in a test set, or twice in the pool", false},
    {"topology", "write a topology file for a lab's labels, and show which points are left and right", false},
    {"export", "write a dataset in another project's format: PRIMA, COCO, Parquet, Hugging Face", false},
    {"corrections", "take corrected keypoints and vetoes back from an exported COCO file", false},
    {"merge", "join finished datasets to a new version", false},
    {"subset", "make a version of the candidates that fulfil a condition", false},
    {"diff", "show which verdicts and labels changed between two versions, and by how much", false},
    {"curate", "choose a balanced subset of a large dataset, by species; build takes the list", false},
    {"completion", "print a script that completes commands and options in bash, zsh or fish", true},
    {"man", "print the manual page", true},
}};

// Declares the command on the application, with its description. Throws std::logic_error for a name that
// kCommands lacks.
CLI::App* declare(CLI::App& app, std::string_view name);

// Runs a command that was chosen and returns the exit code. Throws ConfigError, Interrupted, std::exception.
using Command = std::function<int()>;

Command add_build(CLI::App& app);
Command add_calibrate(CLI::App& app);
Command add_predict(CLI::App& app);
Command add_verify(CLI::App& app);
Command add_status(CLI::App& app);
Command add_verify_with_repair(CLI::App& app);  // of quadruped3d-network, which can build
Command add_inspect(CLI::App& app);
Command add_inspect_with_sheets(CLI::App& app);  // of quadruped3d-network, which can pose bodies
Command add_overlay(CLI::App& app);
Command add_report(CLI::App& app);
Command add_explain(CLI::App& app);
Command add_leakage(CLI::App& app);
Command add_init(CLI::App& app);
Command add_sample(CLI::App& app);
Command add_train(CLI::App& app);
Command add_evaluate(CLI::App& app);
Command add_evaluate_labels(CLI::App& app);
Command add_compare(CLI::App& app);
Command add_compare_labels(CLI::App& app);
Command add_config(CLI::App& app);
Command add_curate(CLI::App& app);
Command add_topology(CLI::App& app);
Command add_export(CLI::App& app);
Command add_corrections(CLI::App& app);
Command add_merge(CLI::App& app);
Command add_subset(CLI::App& app);
Command add_diff(CLI::App& app);
// These describe all commands of `app`, which must outlive what they return.
Command add_completion(CLI::App& app);
Command add_man(CLI::App& app);

}  // namespace q3d::pipeline::cli
