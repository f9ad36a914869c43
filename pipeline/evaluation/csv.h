// Comma-separated values as RFC 4180 has them: fields with commas, quotes or line breaks are quoted.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::evaluation {

using CsvRow = std::vector<std::string>;

std::string csv_line(const CsvRow& fields);  // with the line break

// All rows, the header included; lines end with LF or CRLF. Throws std::invalid_argument naming the line
// where a quoted field does not end, or where a row has another number of fields than the first.
std::vector<CsvRow> parse_csv(std::string_view text);

// The position of a column in the header, so that a later version may add some. Throws std::invalid_argument
// naming the column when it is not there.
std::size_t column_of(const CsvRow& header, const std::string& name);

// A field that holds a number or nothing. Throws std::invalid_argument on anything else.
std::optional<double> number_of(const std::string& field);

}  // namespace q3d::pipeline::evaluation
