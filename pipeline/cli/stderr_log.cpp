#include "pipeline/cli/stderr_log.h"

#include <fmt/format.h>
#include <cstdio>

#include "pipeline/run/printable.h"

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

void StderrLog::write(run::LogLevel level, std::string_view line) {
  run::erase_terminal_line();
  fmt::print(stderr, "{}{}\n", prefix(level), run::printable_line(line));
}

}  // namespace q3d::pipeline::cli
