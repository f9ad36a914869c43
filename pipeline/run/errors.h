// The two failures that the command line tells apart from every other.
#pragma once

#include <stdexcept>

namespace q3d::pipeline::run {

// Wrong usage or configuration: exit code 2. Everything else that throws is a failure at run time: exit
// code 1.
class ConfigError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

// The user asked to stop (interrupt.h has the exit codes). What was finished stays, the open unit is dropped.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace q3d::pipeline::run
