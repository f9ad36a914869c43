// The three standard streams, whatever state they are in and whatever is written to them.
#pragma once

#include <string>

namespace q3d::pipeline::cli {

// Call it before the program opens any file.
// - A standard stream that is closed is opened on /dev/null, so that no file of the program gets its number
// and
//   receives its messages.
// - What goes to stderr, and to stdout if that is a terminal, has its control characters written out (\x1b),
// so that
//   a name from a file cannot move the cursor or set colours. Line feeds and tabs stay.
// - A stderr that cannot be written (a full disk) is not an error: its text is lost.
void prepare_standard_streams();

// Writes what is still to be written to stdout. Throws std::runtime_error if anything that was printed has
// not arrived, because then the command has not done what it was asked for.
void finish_stdout();

// Whether something that was printed to stdout has not arrived.
bool stdout_failed();
// The message for a stdout that cannot be written; `reason` is the system's.
std::string unwritten_stdout(const std::string& reason);

}  // namespace q3d::pipeline::cli
