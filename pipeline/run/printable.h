// Text that a terminal shows as it is. Names come from files, and may hold sequences that move the cursor,
// set colours, or begin a line of their own.
#pragma once

#include <string>
#include <string_view>

namespace q3d::pipeline::run {

// Returns the text with its control characters written out: ESC as \x1b. Line feeds and tabs stay. The text
// is UTF-8; bytes that are none stay as they are.
std::string printable_text(std::string_view text);

// The same for what must stay on one line: line feeds become \n and tabs \t.
std::string printable_line(std::string_view text);

// Draws a line of the program's own making on the terminal at stderr, in the place of the line on which its
// cursor stands. Its control characters work, so no text of a file may be part of it. It does nothing if
// stderr is no terminal.
void draw_terminal_line(std::string_view line);

// Erases the line on which the cursor of a terminal at stderr stands. It does nothing if stderr is none.
void erase_terminal_line();

}  // namespace q3d::pipeline::run
