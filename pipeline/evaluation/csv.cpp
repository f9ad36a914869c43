#include "pipeline/evaluation/csv.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>

namespace q3d::pipeline::evaluation {
namespace {

std::string quoted_where_needed(const std::string& field) {
  if (field.find_first_of(",\"\r\n") == std::string::npos) return field;
  std::string quoted = "\"";
  for (const char c : field) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

class CsvParser {
 public:
  explicit CsvParser(std::string_view text) : text_(text) {}

  std::vector<CsvRow> parse() {
    while (at_ < text_.size()) {
      CsvRow row = read_row();
      if (!rows_.empty() && row.size() != rows_.front().size()) {
        fail("got " + std::to_string(row.size()) + " fields, expected " +
             std::to_string(rows_.front().size()));
      }
      rows_.push_back(std::move(row));
    }
    return std::move(rows_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(row_start_), '\n');
    throw std::invalid_argument("line " + std::to_string(line) + ": " + what);
  }

  // Takes the row's line break too.
  CsvRow read_row() {
    row_start_ = at_;
    CsvRow row;
    while (true) {
      row.push_back(read_field());
      if (at_ == text_.size()) return row;
      if (text_[at_++] == '\n') return row;
    }
  }

  // Stops at the comma or line feed behind the field, or at the end.
  std::string read_field() {
    std::string field;
    const bool quoted = at_ < text_.size() && text_[at_] == '"';
    if (quoted) field = read_quoted();
    while (at_ < text_.size() && text_[at_] != ',' && text_[at_] != '\n') field += text_[at_++];
    const bool ends_line = at_ == text_.size() || text_[at_] == '\n';
    if (ends_line && field.ends_with('\r')) field.pop_back();
    return field;
  }

  std::string read_quoted() {
    std::string field;
    for (++at_; at_ < text_.size(); ++at_) {
      if (text_[at_] != '"') {
        field += text_[at_];
      } else if (at_ + 1 < text_.size() && text_[at_ + 1] == '"') {
        field += text_[++at_];
      } else {
        ++at_;
        return field;
      }
    }
    fail("a quoted field does not end");
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t row_start_ = 0;
  std::vector<CsvRow> rows_;
};

}  // namespace

std::string csv_line(const CsvRow& fields) {
  std::string line;
  for (const std::string& field : fields)
    line += (line.empty() && &field == fields.data() ? "" : ",") + quoted_where_needed(field);
  return line + '\n';
}

std::vector<CsvRow> parse_csv(std::string_view text) {
  return CsvParser(text).parse();
}

std::size_t column_of(const CsvRow& header, const std::string& name) {
  const auto found = std::find(header.begin(), header.end(), name);
  if (found == header.end()) throw std::invalid_argument("the column \"" + name + "\" is missing");
  return static_cast<std::size_t>(found - header.begin());
}

std::optional<double> number_of(const std::string& field) {
  if (field.empty()) return std::nullopt;
  double value = 0.0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || end != field.data() + field.size()) {
    throw std::invalid_argument("got \"" + field + "\", expected a number or nothing");
  }
  return value;
}

}  // namespace q3d::pipeline::evaluation
