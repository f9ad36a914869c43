// The abilities of the terminal at stderr: to redraw a line in place, and to show colours.
#pragma once

namespace q3d::pipeline::run {

struct Terminal {
  bool redraws = false;     // stderr is a terminal that understands control sequences (TERM is not "dumb")
  bool has_colour = false;  // it redraws, and the environment does not say NO_COLOR (https://no-color.org)
  int columns = 80;         // its width
};

// Returns the current abilities. A window may change its width, so call it each time.
Terminal terminal_of_stderr();

}  // namespace q3d::pipeline::run
