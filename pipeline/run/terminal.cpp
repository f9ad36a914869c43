#include "pipeline/run/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace q3d::pipeline::run {
namespace {

std::string_view variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string_view() : std::string_view(value);
}

}  // namespace

Terminal terminal_of_stderr() {
  Terminal terminal;
  terminal.redraws = isatty(STDERR_FILENO) != 0 && variable("TERM") != "dumb";
  if (!terminal.redraws) return terminal;
  terminal.has_colour = variable("NO_COLOR").empty();
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) terminal.columns = size.ws_col;
  return terminal;
}

}  // namespace q3d::pipeline::run
