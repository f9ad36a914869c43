// Work in a process of its own, for libraries that a damaged file can crash.
#pragma once

#include <chrono>
#include <functional>
#include <string>

namespace q3d::loaders::formats {

// What `work` returns, run in a child of this process, which can neither end nor corrupt this one. `work`
// sees this process's memory as it is now and the calling thread alone; locks that other threads hold stay
// locked for it. Throws std::runtime_error with the message of what `work` throws; where the child crashes,
// or takes longer than `limit`, one that says so; std::system_error when there can be no child.
std::string in_own_process(const std::function<std::string()>& work, std::chrono::seconds limit);

}  // namespace q3d::loaders::formats
