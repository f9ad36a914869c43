// DeepLabCut's CSV. It has one header row for each level ("scorer", "individuals" if there are several,
// "bodyparts", "coords") and then one row for each frame. The name of the frame is in the first cell or in
// the first three.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <stdexcept>
#include <string_view>

#include "loaders/formats/label_table.h"
#include "manifests/atomic_file.h"
#include "manifests/csv.h"

namespace q3d::loaders::formats {
namespace {

using manifests::CsvReader;

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{4} << 30U;
constexpr std::array<std::string_view, 4> kLevels{"scorer", "individuals", "bodyparts", "coords"};

// The header's rows.
struct Header {
  std::vector<std::vector<std::string>> levels;
  std::size_t name_cells = 1;  // leading cells that name a frame
};

// Reads the header. `cells` then holds the first row of the frames (empty if there is none).
Header read_header(CsvReader& lines, std::vector<std::string>& cells) {
  Header header;
  while (lines.next(cells)) {
    if (std::find(kLevels.begin(), kLevels.end(), cells[0]) == kLevels.end()) break;
    header.levels.push_back(cells);
    if (header.levels.back().size() != header.levels.front().size()) {
      lines.fail(fmt::format("{} cells", cells.size()), fmt::format("{}", header.levels.front().size()));
    }
    cells.clear();
  }
  const auto names = [&](std::size_t i) { return header.levels[i][0]; };
  const bool is_single =
      header.levels.size() == 3 && names(0) == "scorer" && names(1) == "bodyparts" && names(2) == "coords";
  const bool is_multi = header.levels.size() == 4 && names(0) == "scorer" && names(1) == "individuals" &&
                        names(2) == "bodyparts" && names(3) == "coords";
  if (!is_single && !is_multi) {
    lines.fail(fmt::format("a header of {} rows", header.levels.size()),
               "rows that start with scorer, individuals (if several), bodyparts, coords");
  }
  const std::vector<std::string>& scorers = header.levels.front();
  while (header.name_cells < scorers.size() && scorers[header.name_cells].empty()) ++header.name_cells;
  if (header.name_cells == scorers.size()) lines.fail("no scorer", "one for every column");
  return header;
}

double number(CsvReader& lines, const std::string& cell, const LabelColumn& column) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  if (cell.empty()) return kNaN;
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error == std::errc() && end == cell.data() + cell.size()) return value;
  lines.fail(fmt::format("\"{}\" for {} of {}", cell.substr(0, 40), column.coordinate, column.bodypart),
             "a number or nothing");
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

std::string read_text(const std::filesystem::path& file) {
  const auto bytes = std::filesystem::file_size(file);
  if (bytes > kMaxFileBytes) {
    throw std::runtime_error(fmt::format("{}: got {} bytes, expected a CSV file of at most {}", file.string(),
                                         bytes, kMaxFileBytes));
  }
  return manifests::read_file(file);
}

}  // namespace

LabelTable read_label_csv(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  CsvReader lines(text, file.string());
  std::vector<std::string> cells;
  const Header header = read_header(lines, cells);
  const std::size_t width = header.levels.front().size();
  LabelTable table;
  for (std::size_t column = header.name_cells; column < width; ++column) {
    std::vector<std::string> names;
    for (const auto& level : header.levels) names.push_back(level[column]);
    table.columns.push_back(
        label_column(std::move(names), fmt::format("{}: column {}", file.string(), column)));
  }
  table.rows_are_numbers = header.name_cells == 1;
  for (bool more = !cells.empty(); more; more = lines.next(cells)) {
    if (cells.size() != width) lines.fail(fmt::format("{} cells", cells.size()), fmt::format("{}", width));
    const auto first = cells.begin() + static_cast<std::ptrdiff_t>(header.name_cells);
    table.rows.push_back(row_name({cells.begin(), first}));
    table.rows_are_numbers = table.rows_are_numbers && is_number(cells[0]);
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      table.values.push_back(number(lines, cells[header.name_cells + i], table.columns[i]));
    }
  }
  return table;
}

}  // namespace q3d::loaders::formats
