#include "manifests/csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace q3d::manifests {

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

bool CsvReader::next(std::vector<std::string>& cells) {
  cells.clear();
  while (at_ < text_.size()) {
    ++line_;
    do {
      cells.push_back(cell());
    } while (take(','));
    take('\r');
    if (at_ < text_.size() && !take('\n')) {
      fail("text after a closing quote, or a lone CR", "a comma or the line's end");
    }
    if (cells.size() > 1 || !cells[0].empty()) return true;
    cells.clear();
  }
  return false;
}

void CsvReader::fail(const std::string& got, const std::string& expected) const {
  throw std::runtime_error(fmt::format("{}: line {}: got {}, expected {}", where_, line_, got, expected));
}

bool CsvReader::take(char c) {
  if (at_ >= text_.size() || text_[at_] != c) return false;
  ++at_;
  return true;
}

std::string CsvReader::cell() {
  if (!take('"')) {
    const std::size_t end = std::min(text_.find_first_of(",\r\n", at_), text_.size());
    const std::size_t start = std::exchange(at_, end);
    return text_.substr(start, end - start);
  }
  std::string quoted;
  while (true) {
    const std::size_t quote = text_.find('"', at_);
    if (quote == std::string::npos) fail("a quote that is not closed", "its end");
    quoted.append(text_, at_, quote - at_);
    at_ = quote + 1;
    if (!take('"')) return quoted;
    quoted += '"';
  }
}

}  // namespace q3d::manifests
