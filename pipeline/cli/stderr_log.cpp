#include "pipeline/cli/stderr_log.h"

#include <fmt/format.h>

#include <cstdio>

#include "pipeline/run/terminal.h"

namespace q3d::pipeline::cli {
namespace {

std::string_view prefix(run::LogLevel level) {
  switch (level) {
    case run::LogLevel::info:
      break;
    case run::LogLevel::note:
      return "note: ";
    case run::LogLevel::warning:
      return "warning: ";
  }
  return "";
}

}  // namespace

StderrLog::StderrLog() : terminal_(run::terminal_of_stderr().redraws) {}

void StderrLog::write(run::LogLevel level, std::string_view line) {
  fmt::print(stderr, "{}{}{}\n", terminal_ ? "\r\033[K" : "", prefix(level), line);
}

}  // namespace q3d::pipeline::cli
