// Comma-separated values in the form of RFC 4180 and Python's csv module.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace q3d::manifests {

// Returns the text as one cell. It is quoted if it contains a comma, a quote or the end of a line.
std::string csv_cell(const std::string& text);

// Reads the cells of one line after the other. Lines end in LF or CRLF; empty lines are skipped.
class CsvReader {
 public:
  // `where` names the file in messages. The text must outlive the reader.
  CsvReader(const std::string& text, std::string where) : text_(text), where_(std::move(where)) {}

  // Reads the next line. Returns false at the end of the text. Throws like fail() if a quote is not closed or
  // if text follows a closing quote.
  bool next(std::vector<std::string>& cells);

  // Throws std::runtime_error that names file and line, what was found and what was expected.
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const;

 private:
  bool take(char c);
  std::string cell();

  const std::string& text_;
  std::string where_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;  // line of the cells read last, from 1
};

}  // namespace q3d::manifests
