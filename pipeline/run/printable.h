// Makes texts safe for a terminal. Names come from files, and may contain sequences that move the cursor, set
// colours, or begin a new line.
#pragma once

#include <string>
#include <string_view>

namespace q3d::pipeline::run {

// Returns the text with its control characters written out: ESC as \x1b. Line feeds and tabs stay. The text
// is UTF-8; other bytes are unchanged.
std::string printable_text(std::string_view text);

// Returns such a text on one line: line feeds become
// and tabs \t.
std::string printable_line(std::string_view text);

// Draws a line that the program itself has made on the terminal at stderr, replacing the line of the cursor.
// Its control characters work, so no text of a file may be part of it. It does nothing if stderr is no
// terminal.
void draw_terminal_line(std::string_view line);

// Erases the cursor's line on the terminal at stderr. It does nothing if stderr is no terminal.
void erase_terminal_line();

}  // namespace q3d::pipeline::run
