// Tables of the stages: bytes of a file, and tables whose columns have other types, shapes and lengths than
// those that the program writes.
//
// An input that is no HDF5 file is a list of changes to a sound table, three bytes each: which column, what
// to do with it, and a number.
#include <algorithm>
#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "manifests/table.h"
#include "pipeline/unit/unit_tables.h"
#include "tests/fuzz/fuzz_input.h"

// HDF5 1.10 leaks memory of its own when it refuses a damaged file.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libhdf5";
}

namespace {

using q3d::fuzz::require;
using q3d::manifests::ElementType;
using q3d::manifests::NumericColumn;
using q3d::manifests::Table;
namespace unit = q3d::pipeline::unit;

// A reader may refuse the table, and then says which column is wrong.
void value_or_named_column(const std::function<void()>& read) {
  try {
    read();
  } catch (const std::runtime_error& error) {
    require(std::string_view(error.what()).find("column") != std::string_view::npos,
            "a refusal names the column", error.what());
  }
}

void read_stages(const Table& table) {
  const auto rows = static_cast<std::size_t>(table.rows);
  value_or_named_column(
      [&] { require(unit::predicted_from_table(table).size() == rows, "a table has its rows"); });
  value_or_named_column([&] {
    for (std::size_t row = 0; row < rows; ++row) unit::candidate_from_table(table, row);
  });
  value_or_named_column(
      [&] { require(unit::refined_from_table(table).size() == rows, "a table has its rows"); });
  value_or_named_column(
      [&] { require(unit::measured_from_table(table).size() == rows, "a table has its rows"); });
  value_or_named_column(
      [&] { require(unit::crops_from_table(table).size() == rows, "a table has its rows"); });
}

// One table with the columns of all stages.
Table sound_table() {
  constexpr std::size_t kRows = 3;
  std::vector<q3d::pipeline::candidates::Candidate> candidates(kRows);
  std::vector<unit::RefinedSample> refined(kRows);
  std::vector<unit::MeasuredLabel> measured(kRows);
  std::vector<unit::EncodedCrop> crops(kRows);
  for (std::size_t i = 0; i < kRows; ++i) {
    candidates[i].record.id = "set/train/a.jpg#" + std::to_string(i);
    refined[i].sample = measured[i].sample = crops[i].sample = i;
    refined[i].curve = refined[i].held_out_curve = {0.5, 0.25};
    crops[i].picture = crops[i].mask = std::vector<std::byte>(i + 1);
  }
  Table table = unit::to_table(candidates, std::vector<unit::PredictedSample>(kRows));
  for (const Table& other : {unit::to_table(refined), unit::to_table(measured), unit::to_table(crops)}) {
    table.numeric.insert(other.numeric.begin(), other.numeric.end());
    table.blobs.insert(other.blobs.begin(), other.blobs.end());
    for (const auto& [name, views] : other.blob_views) {
      for (const auto view : views) table.blobs[name].emplace_back(view.begin(), view.end());
    }
  }
  return table;
}

template <typename Columns>
auto pick(Columns& columns, std::uint8_t number) {
  return std::next(columns.begin(), number % static_cast<std::ptrdiff_t>(columns.size()));
}

// A table that read_table could give: every column has all rows.
void change(Table& table, std::uint8_t which, std::uint8_t how, std::uint8_t number) {
  if (how % 8 == 0 && !table.text.empty()) {
    pick(table.text, which)->second[number % static_cast<std::size_t>(table.rows)] = std::string(number, 'x');
  } else if (how % 8 == 1 && !table.text.empty()) {
    table.text.erase(pick(table.text, which));
  } else if (how % 8 == 2 && !table.blobs.empty()) {
    table.blobs.erase(pick(table.blobs, which));
  } else if (how % 8 == 3 && !table.blobs.empty()) {
    pick(table.blobs, which)->second.front().resize(number);
  } else if (how % 8 == 4 && !table.numeric.empty()) {
    table.numeric.erase(pick(table.numeric, which));
  } else if (!table.numeric.empty()) {
    NumericColumn& column = pick(table.numeric, which)->second;
    if (how % 8 == 5) column.type = static_cast<ElementType>(number % 6);
    if (how % 8 == 6) column.row_shape = {number % 4, 1 + number / 4 % 3};
    const auto bytes = q3d::manifests::elements_per_row(column.row_shape) * table.rows *
                       static_cast<std::int64_t>(size_of(column.type));
    column.data.resize(static_cast<std::size_t>(bytes));
    if (how % 8 == 7 && !column.data.empty()) column.data[number % column.data.size()] ^= std::byte{0x81};
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = q3d::fuzz::as_text(data, size);
  if (text.starts_with("\x89HDF")) {
    q3d::fuzz::value_or_refusal("unit.h5", [&] {
      const auto bytes = std::as_bytes(std::span(data, size));
      read_stages(q3d::manifests::read_table("unit.h5", {bytes.begin(), bytes.end()}));
    });
    return 0;
  }
  static const Table sound = sound_table();
  Table table = sound;
  for (std::size_t at = 0; at + 3 <= std::min<std::size_t>(size, 96); at += 3) {
    change(table, data[at], data[at + 1], data[at + 2]);
  }
  read_stages(table);
  return 0;
}
