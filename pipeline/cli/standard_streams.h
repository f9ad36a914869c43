// Makes the three standard streams safe, whatever their state is and whatever is written to them.
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

// Flushes stdout. Throws std::runtime_error if any printed text has not arrived, because the command has then
// failed.
void finish_stdout();

// Returns whether any text that was printed to stdout has not arrived.
bool stdout_failed();
// Returns the message for a stdout that cannot be written. `reason` is the system's text.
std::string unwritten_stdout(const std::string& reason);

}  // namespace q3d::pipeline::cli
