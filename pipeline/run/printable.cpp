#include "pipeline/run/printable.h"

#include <unistd.h>

#include <algorithm>

#include "pipeline/run/terminal.h"

namespace q3d::pipeline::run {
namespace {

constexpr unsigned char kDelete = 0x7f;
// The control characters U+0080 to U+009F are two bytes in UTF-8. U+009B is another spelling of ESC [.
constexpr unsigned char kFirstOfC1 = 0xc2;
bool is_second_of_c1(unsigned char c) {
  return c >= 0x80 && c <= 0x9f;
}

void append_hex(std::string& text, unsigned char c) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  text += "\\x";
  text += kDigits[c >> 4U];
  text += kDigits[c & 15U];
}

bool is_control(unsigned char c) {
  return c < 0x20 || c == kDelete;
}

std::string printable(std::string_view text, std::string_view kept) {
  std::string shown;
  shown.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const bool is_c1 =
        c == kFirstOfC1 && i + 1 < text.size() && is_second_of_c1(static_cast<unsigned char>(text[i + 1]));
    if (is_c1) {
      append_hex(shown, static_cast<unsigned char>(text[++i]));
    } else if (!is_control(c) || kept.find(text[i]) != std::string_view::npos) {
      shown += text[i];
    } else if (c == '\n' || c == '\t' || c == '\r') {
      shown += c == '\n' ? "\\n" : c == '\t' ? "\\t" : "\\r";
    } else {
      append_hex(shown, c);
    }
  }
  return shown;
}

}  // namespace

std::string printable_text(std::string_view text) {
  return printable(text, "\n\t");
}

std::string printable_line(std::string_view text) {
  return printable(text, "");
}

void draw_terminal_line(std::string_view line) {
  if (!terminal_of_stderr().redraws) return;
  const std::string drawn = "\r\033[K" + std::string(line);
  const ssize_t written = write(STDERR_FILENO, drawn.data(), drawn.size());
  static_cast<void>(written);  // a failure means that the terminal is gone
}

void erase_terminal_line() {
  draw_terminal_line("");
}

}  // namespace q3d::pipeline::run
