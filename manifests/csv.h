// Comma-separated values, as RFC 4180 and Python's csv module have them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace q3d::manifests {

// The text as one cell: quoted where it holds a comma, a quote or a line's end.
std::string csv_cell(const std::string& text);

// Cells of one line after the other. Lines end in LF or CRLF; empty ones are passed over.
class CsvReader {
 public:
  // `where` names the file in messages. The text outlives the reader.
  CsvReader(const std::string& text, std::string where) : text_(text), where_(std::move(where)) {}

  // False at the end. Throws as fail() does for a quote that is not closed, or text after a closing one.
  bool next(std::vector<std::string>& cells);

  // Throws std::runtime_error naming file and line, got and expected.
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const;

 private:
  bool take(char c);
  std::string cell();

  const std::string& text_;
  std::string where_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;  // of the cells last read, from 1
};

}  // namespace q3d::manifests
