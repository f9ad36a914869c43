// The two failures that the command line handles separately.
#pragma once

#include <stdexcept>

namespace q3d::pipeline::run {

// Wrong usage or configuration, which gives exit code 2. Every other exception is a failure at run time and
// gives exit code 1.
class ConfigError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

// Says that the user asked to stop (interrupt.h has the exit codes). Finished results stay, and the open unit
// is dropped.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace q3d::pipeline::run
