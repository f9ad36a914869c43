// Reads and writes comma-separated values in the form of RFC 4180 and Python's csv module. All CSV files pass
// through here. Each loader handles what its format adds (DeepLabCut's header of several rows, pandas' empty
// cells).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::manifests {

using CsvRow = std::vector<std::string>;

// Returns the text as one cell. It is quoted if it contains a comma, a quote or the end of a line.
std::string csv_cell(const std::string& text);
// Returns the cells as one line, with its line feed. A line that consists of one empty cell is written as
// "", because an empty line is no row.
std::string csv_line(const CsvRow& cells);

// Reads a text line by line and splits each line into cells. Lines end in LF or CRLF; empty lines are
// skipped.
class CsvReader {
 public:
  // `where` names the file in messages. The text must outlive the reader. Spreadsheets of some countries
  // separate cells by semicolons, and others by tabs.
  CsvReader(std::string_view text, std::string where, char separator = ',')
      : text_(text), where_(std::move(where)), separator_(separator) {}

  // Reads the next line. Returns false at the end of the text. Throws like fail() if a quote is not closed or
  // if text follows a closing quote.
  bool next(CsvRow& cells);

  // Throws std::runtime_error that names file and line, what was found and what was expected. The line is the
  // one on which the cells that were read last begin.
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const;

 private:
  bool take(char c);
  bool take_line_end();
  std::string cell();

  std::string_view text_;
  std::string where_;
  char separator_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;       // where the cells that were read last begin, from 1
  std::size_t next_line_ = 1;  // where the next cells begin
};

// Reads a table whose first line names its columns. Columns are found by name, so that a later version of a
// file may add some.
class CsvTableReader {
 public:
  // Reads the first line. Throws like CsvReader::fail if there is none. The text must outlive the reader.
  CsvTableReader(std::string_view text, std::string where);

  // Returns the position of a column. Throws like fail() if the table has no such column.
  std::size_t column(const std::string& name) const;
  // The same for a column that not every version of the file has.
  std::optional<std::size_t> find_column(const std::string& name) const;
  // Reads the next row. Returns false at the end of the text. Throws like CsvReader::next, and if the row has
  // another number of cells than the first line.
  bool next();

  // These return a cell of the row that was read last: as text, and as a number if it holds one. number()
  // returns nothing for an empty cell and throws like fail() for any other text.
  const std::string& cell(std::size_t column) const { return cells_.at(column); }
  std::optional<double> number(std::size_t column) const;

  [[noreturn]] void fail(const std::string& got, const std::string& expected) const {
    lines_.fail(got, expected);
  }

 private:
  CsvReader lines_;
  CsvRow header_;
  CsvRow cells_;
};

}  // namespace q3d::manifests
