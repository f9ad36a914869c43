#include "manifests/csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <stdexcept>
#include <utility>

namespace q3d::manifests {

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

std::string csv_line(const CsvRow& cells) {
  if (cells.size() == 1 && cells[0].empty()) return "\"\"\n";
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i) line += (i == 0 ? "" : ",") + csv_cell(cells[i]);
  return line + '\n';
}

bool CsvReader::next(CsvRow& cells) {
  cells.clear();
  while (take_line_end()) ++next_line_;  // empty lines
  if (at_ >= text_.size()) return false;
  const std::size_t start = at_;
  line_ = next_line_;
  do {
    cells.push_back(cell());
  } while (take(separator_));
  if (at_ < text_.size() && !take_line_end()) {
    fail("text after a closing quote, or a lone CR",
         separator_ == ',' ? "a comma or the line's end" : "a separator or the line's end");
  }
  next_line_ += static_cast<std::size_t>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(start),
                                                    text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n'));
  return true;
}

void CsvReader::fail(const std::string& got, const std::string& expected) const {
  throw std::runtime_error(fmt::format("{}: line {}: got {}, expected {}", where_, line_, got, expected));
}

bool CsvReader::take(char c) {
  if (at_ >= text_.size() || text_[at_] != c) return false;
  ++at_;
  return true;
}

// Takes the end of a line, if there is one. The end of the text also ends a line, but there is nothing to
// take. A CR at the end of the text counts as CRLF.
bool CsvReader::take_line_end() {
  const std::string_view rest = text_.substr(std::min(at_, text_.size()));
  if (!rest.starts_with('\n') && !rest.starts_with("\r\n") && rest != "\r") return false;
  at_ += rest.starts_with("\r\n") ? 2 : 1;
  return true;
}

std::string CsvReader::cell() {
  if (!take('"')) {
    const std::array<char, 3> ends{separator_, '\r', '\n'};
    const std::size_t end =
        std::min(text_.find_first_of(std::string_view(ends.data(), ends.size()), at_), text_.size());
    const std::size_t start = std::exchange(at_, end);
    return std::string(text_.substr(start, end - start));
  }
  std::string quoted;
  while (true) {
    const std::size_t quote = text_.find('"', at_);
    if (quote == std::string_view::npos) fail("a quote that is not closed", "its end");
    quoted.append(text_.substr(at_, quote - at_));
    at_ = quote + 1;
    if (!take('"')) return quoted;
    quoted += '"';
  }
}

CsvTableReader::CsvTableReader(std::string_view text, std::string where) : lines_(text, std::move(where)) {
  if (!lines_.next(header_)) lines_.fail("an empty file", "a line that names the columns");
}

std::size_t CsvTableReader::column(const std::string& name) const {
  const std::optional<std::size_t> found = find_column(name);
  if (!found) lines_.fail("no column \"" + name + "\"", "one");
  return *found;
}

std::optional<std::size_t> CsvTableReader::find_column(const std::string& name) const {
  const auto found = std::find(header_.begin(), header_.end(), name);
  if (found == header_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - header_.begin());
}

bool CsvTableReader::next() {
  if (!lines_.next(cells_)) return false;
  if (cells_.size() != header_.size()) {
    lines_.fail(fmt::format("{} cells", cells_.size()), std::to_string(header_.size()));
  }
  return true;
}

std::optional<double> CsvTableReader::number(std::size_t column) const {
  const std::string& text = cell(column);
  if (text.empty()) return std::nullopt;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    lines_.fail(fmt::format("\"{}\" for {}", text.substr(0, 40), header_[column]), "a number or nothing");
  }
  return value;
}

}  // namespace q3d::manifests
