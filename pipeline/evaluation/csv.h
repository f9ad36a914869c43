// Comma-separated values as RFC 4180 has them: fields with commas, quotes or line breaks are quoted.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::evaluation {

using CsvRow = std::vector<std::string>;

std::string csv_line(const CsvRow& fields);  // with the line break

// All rows, the header included; lines end with LF or CRLF. Throws std::invalid_argument naming the line
// where a quoted field does not end, or where a row has another number of fields than the first.
std::vector<CsvRow> parse_csv(std::string_view text);

}  // namespace q3d::pipeline::evaluation
