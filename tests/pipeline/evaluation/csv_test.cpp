#include "pipeline/evaluation/csv.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "pipeline/evaluation/text_table.h"

namespace q3d::pipeline::evaluation {
namespace {

TEST(Csv, QuotesOnlyWhatNeedsIt) {
  EXPECT_EQ(csv_line({"a", "", "b,c", "d\"e", "f\ng"}), "a,,\"b,c\",\"d\"\"e\",\"f\ng\"\n");
}

TEST(Csv, ReadsRfc4180) {
  const std::vector<CsvRow> expected{{"a", "b"}, {"1", ""}, {"x,\"y\"", "z\r\nw"}, {"", "last"}};
  EXPECT_EQ(parse_csv("a,b\r\n1,\r\n\"x,\"\"y\"\"\",\"z\r\nw\"\n,last"), expected);
  EXPECT_TRUE(parse_csv("").empty());
}

TEST(Csv, ReadsWhatItWrites) {
  const std::vector<CsvRow> rows{{"id", "v"}, {"a/b,c#1", "\"\""}, {"", ""}, {"line\nbreak", "3.5"}};
  std::string text;
  for (const CsvRow& row : rows) text += csv_line(row);
  EXPECT_EQ(parse_csv(text), rows);
}

TEST(Csv, NamesTheLine) {
  const auto message = [](const char* text) {
    try {
      parse_csv(text);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("nothing thrown");
  };
  EXPECT_EQ(message("a,b\n1,2\n3\n"), "line 3: got 1 fields, expected 2");
  EXPECT_EQ(message("a,b\n1,\"2\n3"), "line 2: a quoted field does not end");
}

TEST(TextTable, AlignsTextLeftAndNumbersRight) {
  TextTable table({"name", "n"}, 1);
  table.add({"a", "100"});
  table.add({"longer", ""});
  EXPECT_EQ(table.text(), "name      n\na       100\nlonger\n");
  EXPECT_THROW(table.add({"one"}), std::logic_error);
  EXPECT_EQ(cell(1.25, 1), "1.2");
  EXPECT_EQ(cell(std::nullopt, 1), "-");
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
