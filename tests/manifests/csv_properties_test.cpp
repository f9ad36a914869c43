// A table that is written as CSV is read back unchanged, whatever the cells hold.
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "manifests/csv.h"
#include "tests/support/properties.h"

namespace q3d::manifests {
namespace {

using Rows = std::vector<std::vector<std::string>>;

// A row has at least two cells, because a row of one empty cell reads as an empty line, which is skipped.
Rows any_rows() {
  const auto row = rc::gen::suchThat(rc::gen::container<std::vector<std::string>>(testing::awkward_text()),
                                     [](const std::vector<std::string>& cells) { return cells.size() >= 2; });
  return *rc::gen::container<Rows>(row);
}

std::string written(const Rows& rows, const std::string& line_end) {
  std::string text;
  for (const auto& cells : rows) {
    for (std::size_t i = 0; i < cells.size(); ++i) text += (i == 0 ? "" : ",") + csv_cell(cells[i]);
    text += line_end;
  }
  return text;
}

Rows read_all(const std::string& text) {
  CsvReader reader(text, "property");
  Rows rows;
  std::vector<std::string> cells;
  while (reader.next(cells)) rows.push_back(cells);
  return rows;
}

RC_GTEST_PROP(CsvProperties, ReadsWhatItWrote, ()) {
  const Rows rows = any_rows();
  RC_ASSERT(read_all(written(rows, "\n")) == rows);
  RC_ASSERT(read_all(written(rows, "\r\n")) == rows);
}

RC_GTEST_PROP(CsvProperties, TheLastLineNeedsNoEnd, ()) {
  const Rows rows = any_rows();
  RC_PRE(!rows.empty());
  std::string text = written(rows, "\n");
  text.pop_back();
  RC_ASSERT(read_all(text) == rows);
}

RC_GTEST_PROP(CsvProperties, EmptyLinesBetweenRowsChangeNothing, ()) {
  const Rows rows = any_rows();
  RC_ASSERT(read_all("\n" + written(rows, "\n\n")) == rows);
}

RC_GTEST_PROP(CsvProperties, PlainTextStaysAsItIs, ()) {
  std::string text = *testing::awkward_text();
  std::erase_if(text, [](char c) { return std::string_view(",\"\r\n").find(c) != std::string_view::npos; });
  RC_ASSERT(csv_cell(text) == text);
}

}  // namespace
}  // namespace q3d::manifests
