// Reads DeepLabCut's CSV. It has one header row for each level ("scorer", "individuals" if there are several,
// "bodyparts", "coords") and then one row for each frame. The name of the frame is in the first cell or in
// the first three.
//
// Many files went through a spreadsheet or through pandas. So cells may be separated by semicolons or tabs,
// decimals by commas, rows may be short or end in empty cells, and empty header cells may hold pandas'
// placeholder "Unnamed: 1_level_0".
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "loaders/formats/label_table.h"
#include "loaders/formats/sleap.h"
#include "manifests/csv.h"
#include "manifests/text_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::CsvReader;
using Cells = std::vector<std::string>;

constexpr std::array<std::string_view, 4> kLevels{"scorer", "individuals", "bodyparts", "coords"};
// The texts that pandas writes or reads for a missing number.
constexpr std::array<std::string_view, 7> kMissing{"", "nan", "NaN", "NA", "N/A", "null", "None"};

// The header's rows, all of one length.
struct Header {
  std::vector<Cells> levels;
  std::size_t name_cells = 1;  // leading cells that name a frame

  std::size_t width() const { return levels.front().size(); }
  bool is_blank(std::size_t column) const {
    return std::all_of(levels.begin(), levels.end(),
                       [&](const Cells& level) { return level[column].empty(); });
  }
};

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

// Returns the separator that the first line has most of.
char separator_of(std::string_view text) {
  const std::string_view line = text.substr(0, text.find_first_of("\r\n"));
  constexpr std::array<char, 3> kSeparators{',', ';', '\t'};
  return *std::max_element(kSeparators.begin(), kSeparators.end(), [&](char a, char b) {
    return std::count(line.begin(), line.end(), a) < std::count(line.begin(), line.end(), b);
  });
}

// Says which tool's table begins with this cell, if it is known.
std::string known_table(std::string_view first_cell) {
  if (first_cell == "track" || first_cell == "frame_idx" || first_cell == "instance.score") {
    return " (SLEAP's analysis CSV begins with \"track\" too, but has the columns frame_idx and nose.x)";
  }
  if (first_cell.starts_with('{') || first_cell.starts_with('[')) {
    return " (this is JSON; if it is COCO's, use \"format\": \"coco\")";
  }
  if (first_cell.ends_with(':') || first_cell.find(": ") != std::string_view::npos) {
    return " (this looks like YAML, such as a project's config.yaml, which holds no labels: name the folder "
           "labeled-data or one of its CollectedData files)";
  }
  if (first_cell.starts_with("sep=")) return " (Excel's own first line: remove it)";
  if (first_cell.find(' ') != std::string_view::npos &&
      first_cell.find_first_not_of("0123456789.- eE") == std::string_view::npos) {
    return " (these are lines of numbers, as YOLO writes them: export the labels as COCO Keypoints instead)";
  }
  return {};
}

void check_levels(const CsvReader& lines, const Header& header, const Cells& first_row) {
  if (header.levels.empty()) {
    const std::string first = first_row.empty() ? std::string() : first_row.front().substr(0, 60);
    lines.fail(fmt::format("\"{}\" in the first cell{}", first, known_table(first)),
               "\"scorer\", with which DeepLabCut's tables begin");
  }
  Cells names;
  for (const Cells& level : header.levels) names.push_back(level.front());
  if (names == Cells{"scorer", "bodyparts", "coords"}) return;
  if (names == Cells{"scorer", "individuals", "bodyparts", "coords"}) return;
  lines.fail(fmt::format("header rows that begin with {}", fmt::join(names, ", ")),
             "scorer, individuals (if there are several), bodyparts, coords");
}

// Reads the header. `cells` then holds the first row of the frames (empty if there is none).
Header read_header(CsvReader& lines, Cells& cells) {
  Header header;
  std::size_t width = 0;
  while (lines.next(cells)) {
    cells[0] = std::string(trimmed(cells[0]));
    if (std::find(kLevels.begin(), kLevels.end(), cells[0]) == kLevels.end()) break;
    for (std::string& cell : cells) {
      if (cell.starts_with("Unnamed: ") && cell.find("_level_") != std::string::npos) cell.clear();
    }
    width = std::max(width, cells.size());
    header.levels.push_back(cells);
    cells.clear();
  }
  check_levels(lines, header, cells);
  for (Cells& level : header.levels) level.resize(width);
  const Cells& scorers = header.levels.front();
  while (header.name_cells < width && scorers[header.name_cells].empty()) ++header.name_cells;
  if (header.name_cells == width) lines.fail("no scorer", "one for every column");
  return header;
}

double number(const CsvReader& lines, std::string_view cell, bool has_decimal_commas,
              const LabelColumn& column) {
  std::string text(trimmed(cell));
  if (std::find(kMissing.begin(), kMissing.end(), text) != kMissing.end()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  if (has_decimal_commas) std::replace(text.begin(), text.end(), ',', '.');
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size()) return value;
  lines.fail(fmt::format("\"{}\" for {} of {}", cell.substr(0, 40), column.coordinate, column.bodypart),
             "a number or nothing");
}

// Lightning Pose ends its predictions with a column that says to which set a frame belongs. Its header is
// "set" in the first row and empty below.
bool is_set_column(const std::vector<std::string>& names) {
  return names.front() == "set" &&
         std::all_of(names.begin() + 1, names.end(), [](const std::string& name) { return name.empty(); });
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

// Splits Python's text of a tuple of texts: "('labeled-data', 'walk', 'img1.png')". pandas writes a row's
// name so if other rows are named by one text. Returns nothing for any other text.
std::optional<std::vector<std::string>> tuple_parts(std::string_view text) {
  if (!text.starts_with('(') || !text.ends_with(')')) return std::nullopt;
  std::vector<std::string> parts;
  std::size_t at = 1;
  while (at + 1 < text.size()) {
    const char quote = text[at];
    if (quote != '\'' && quote != '"') return std::nullopt;
    std::string part;
    for (++at; at < text.size() && text[at] != quote; ++at) {
      if (text[at] == '\\') ++at;
      if (at < text.size()) part += text[at];
    }
    parts.push_back(std::move(part));
    at = std::min(text.find_first_not_of(", ", at + 1), text.size());
  }
  return parts.empty() ? std::nullopt : std::optional(parts);
}

std::string name_of_row(const Cells& cells, std::size_t name_cells) {
  if (auto parts = tuple_parts(trimmed(cells[0]))) return row_name(*parts);
  std::vector<std::string> parts;
  for (std::size_t i = 0; i < name_cells; ++i) {
    if (const std::string_view part = trimmed(cells[i]); !part.empty()) parts.emplace_back(part);
  }
  return row_name(parts);
}

// DeepLabCut writes x, y and perhaps likelihood of a keypoint side by side; pandas may have sorted them. In
// any other order, a row of the header is shifted against the others, and every label would be read as
// another keypoint or as the other coordinate.
void check_groups(const CsvReader& lines, const std::vector<LabelColumn>& columns) {
  for (std::size_t first = 0, end = 0; first < columns.size(); first = end) {
    std::vector<std::string> coordinates;
    const auto is_same = [&](const LabelColumn& column) {
      return column.individual == columns[first].individual && column.bodypart == columns[first].bodypart;
    };
    for (end = first; end < columns.size() && is_same(columns[end]); ++end) {
      coordinates.push_back(columns[end].coordinate);
    }
    const bool are_known = coordinates == Cells{"x", "y"} || coordinates == Cells{"x", "y", "likelihood"} ||
                           coordinates == Cells{"likelihood", "x", "y"};
    if (are_known) continue;
    const LabelColumn& column = columns[first];
    lines.fail(
        fmt::format("the columns {} for {}{}{} side by side", fmt::join(coordinates, ", "), column.individual,
                    column.individual.empty() ? "" : " ", column.bodypart),
        "x, y or x, y, likelihood for each keypoint; one row of the header seems to have slipped against "
        "the others");
  }
}

bool are_blank(const Cells& cells) {
  return std::all_of(cells.begin(), cells.end(),
                     [](const std::string& cell) { return trimmed(cell).empty(); });
}

// pandas writes the name of a table's index below the header, in a line that is empty otherwise.
bool is_index_name(const Cells& cells, const Header& header) {
  if (header.name_cells != 1 || cells.empty()) return false;
  const std::string_view name = trimmed(cells[0]);
  return !name.empty() && name.find_first_of("./\\") == std::string_view::npos &&
         !is_number(std::string(name)) && are_blank({cells.begin() + 1, cells.end()});
}

}  // namespace

LabelTable read_label_csv(const std::filesystem::path& file) {
  const std::string text = manifests::read_text_file(file, "DeepLabCut's .h5 or .csv");
  if (is_sleap_csv(text)) return read_sleap_csv(text, file.string());
  const char separator = separator_of(text);
  CsvReader lines(text, file.string(), separator);
  Cells cells;
  const Header header = read_header(lines, cells);
  LabelTable table;
  std::vector<std::size_t> places;  // index of each column's cell
  for (std::size_t column = header.name_cells; column < header.width(); ++column) {
    if (header.is_blank(column)) continue;  // a spreadsheet's empty columns
    std::vector<std::string> names;
    for (const Cells& level : header.levels) names.push_back(level[column]);
    if (is_set_column(names)) continue;
    table.columns.push_back(
        label_column(std::move(names), fmt::format("{}: column {}", file.string(), column)));
    places.push_back(column);
  }
  check_groups(lines, table.columns);
  table.rows_are_numbers = header.name_cells == 1;
  if (is_index_name(cells, header) && !lines.next(cells)) cells.clear();
  for (bool more = !cells.empty(); more; more = lines.next(cells)) {
    if (are_blank(cells)) continue;
    // pandas fills short rows up with missing values.
    if (cells.size() < header.width()) cells.resize(header.width());
    for (std::size_t i = header.name_cells; i < cells.size(); ++i) {
      const bool is_named = i < header.width() && !header.is_blank(i);
      if (is_named || trimmed(cells[i]).empty()) continue;
      lines.fail(fmt::format("\"{}\" in cell {}", cells[i].substr(0, 40), i + 1),
                 "nothing there, because the header names no column in this place");
    }
    table.rows.push_back(name_of_row(cells, header.name_cells));
    table.rows_are_numbers = table.rows_are_numbers && is_number(table.rows.back());
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      table.values.push_back(number(lines, cells[places[i]], separator != ',', table.columns[i]));
    }
  }
  return table;
}

}  // namespace q3d::loaders::formats
