#include "loaders/formats/label_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/file_descriptor.h"
#include "manifests/valid_utf8.h"

namespace q3d::loaders::formats {

bool is_hdf5(const std::filesystem::path& file) {
  constexpr std::string_view kSignature = "\x89HDF\r\n\x1a\n";
  try {
    const manifests::FileDescriptor opened = manifests::open_input(file);
    std::array<char, kSignature.size()> start{};
    if (opened.size() < start.size()) return false;
    opened.read_at(0, std::as_writable_bytes(std::span(start)));
    return std::string_view(start.data(), start.size()) == kSignature;
  } catch (const manifests::IoError& error) {
    if (!error.names_no_file()) throw;
    throw std::runtime_error(
        fmt::format("{}: {}, expected DeepLabCut's .h5 or .csv", file.string(), error.reason()));
  }
}

namespace {

// Throws if a name is not valid UTF-8. Names become parts of ids and notes, which are written as JSON.
void require_utf8(const LabelTable& table, const std::filesystem::path& file) {
  const bool are_columns =
      std::all_of(table.columns.begin(), table.columns.end(), [](const LabelColumn& column) {
        return manifests::is_utf8(column.scorer) && manifests::is_utf8(column.individual) &&
               manifests::is_utf8(column.bodypart);
      });
  if (are_columns && std::all_of(table.rows.begin(), table.rows.end(), manifests::is_utf8)) return;
  throw std::runtime_error(fmt::format(
      "{}: got a name of a {} with bytes that are no UTF-8, expected the encoding UTF-8: save the file "
      "with it (\"CSV UTF-8\" in Excel)",
      file.string(), are_columns ? "picture" : "keypoint, an individual or a scorer"));
}

}  // namespace

LabelTable read_label_table(const std::filesystem::path& file) {
  LabelTable table = is_hdf5(file) ? read_label_hdf5(file) : read_label_csv(file);
  require_utf8(table, file);
  return table;
}

LabelColumn label_column(std::vector<std::string> names, const std::string& where) {
  constexpr std::array<std::string_view, 3> kCoordinates{"x", "y", "likelihood"};
  if (names.size() != 3 && names.size() != 4) {
    throw std::runtime_error(
        fmt::format("{}: got {} levels of column names ({}), expected scorer, bodyparts, coords or "
                    "scorer, individuals, bodyparts, coords",
                    where, names.size(), fmt::join(names, ", ")));
  }
  LabelColumn column;
  column.scorer = std::move(names.front());
  if (names.size() == 4) column.individual = std::move(names[1]);
  column.bodypart = std::move(names[names.size() - 2]);
  column.coordinate = std::move(names.back());
  if (std::find(kCoordinates.begin(), kCoordinates.end(), column.coordinate) == kCoordinates.end()) {
    throw std::runtime_error(
        fmt::format("{}: coords: got \"{}\", expected x, y or likelihood", where, column.coordinate));
  }
  return column;
}

std::string row_name(const std::vector<std::string>& parts) {
  std::string name = fmt::format("{}", fmt::join(parts, "/"));
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

}  // namespace q3d::loaders::formats
