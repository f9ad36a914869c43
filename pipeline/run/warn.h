// How the library tells a person something that matters even with --quiet: it never prints by itself.
#pragma once

#include <functional>
#include <string>

namespace q3d::pipeline::run {

// Takes one line without a line feed. May be called from several threads at once.
using Warn = std::function<void(const std::string&)>;

}  // namespace q3d::pipeline::run
