// Collects the library's log while a test runs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/run/log.h"

namespace q3d::testing {

// Collects the lines as long as it lives.
class Told : public pipeline::run::LogSink {
 public:
  void write(pipeline::run::LogLevel level, std::string_view line) override {
    if (level == pipeline::run::LogLevel::warning) warnings.emplace_back(line);
  }

  std::vector<std::string> warnings;

 private:
  pipeline::run::LogTo here_{*this};
};

}  // namespace q3d::testing
