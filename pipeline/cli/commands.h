// The subcommands of `quadruped3d`. Each add_* declares one on the application and returns what runs it.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <functional>

namespace q3d::pipeline::cli {

// A command that was chosen: runs it and returns the exit code. Throws ConfigError, Interrupted,
// std::exception.
using Command = std::function<int()>;

Command add_build(CLI::App& app);
Command add_calibrate(CLI::App& app);
Command add_verify(CLI::App& app);
Command add_inspect(CLI::App& app);
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

}  // namespace q3d::pipeline::cli
