// Runs work in a separate process, for libraries that a damaged file can crash.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

namespace q3d::manifests {

// Runs `work` in a child process and returns its result. The child can neither end nor corrupt this process.
// `work` sees this process's memory as it is now, and only the calling thread; locks that other threads hold
// stay locked for it. Throws std::runtime_error with the message of what `work` throws, or with a message
// that says that the child crashed or took longer than `limit`. Throws std::system_error if no child can be
// created.
std::string in_own_process(const std::function<std::string()>& work, std::chrono::seconds limit);

// Runs `work` in a child process as a trial, for work that gives the same each time and that this process is
// to do next. Returns why the child ended (it crashed, exited or took longer than `limit`), or nothing if
// `work` came to its end, whether it returned or threw.
std::optional<std::string> trial_in_own_process(const std::function<void()>& work,
                                                std::chrono::seconds limit);

}  // namespace q3d::manifests
