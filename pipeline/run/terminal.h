// What stderr can show: a line that is drawn again in place, and colours.
#pragma once

namespace q3d::pipeline::run {

struct Terminal {
  bool redraws = false;     // stderr is a terminal that understands control sequences (TERM is not "dumb")
  bool has_colour = false;  // it redraws, and the environment does not say NO_COLOR (https://no-color.org)
  int columns = 80;         // its width
};

// Asks anew at each call, since a window may change its width.
Terminal terminal_of_stderr();

}  // namespace q3d::pipeline::run
