// Runs work in a separate process, for libraries that a damaged file can crash.
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace q3d::loaders::formats {

// Runs `work` in a child process and returns its result. The child can neither end nor corrupt this process.
// `work` sees this process's memory as it is now, and only the calling thread; locks that other threads hold
// stay locked for it. Throws std::runtime_error with the message of what `work` throws, or with a message
// that says that the child crashed or took longer than `limit`. Throws std::system_error if no child can be
// created.
std::string in_own_process(const std::function<std::string()>& work, std::chrono::seconds limit);

}  // namespace q3d::loaders::formats
