#include "manifests/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

namespace q3d::manifests {
namespace {

std::vector<CsvRow> rows(std::string_view text) {
  CsvReader reader(text, "file.csv");
  std::vector<CsvRow> all;
  CsvRow row;
  while (reader.next(row)) all.push_back(row);
  return all;
}

std::string message(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(Csv, QuotesOnlyWhatNeedsIt) {
  EXPECT_EQ(csv_line({"a", "", "b,c", "d\"e", "f\ng"}), "a,,\"b,c\",\"d\"\"e\",\"f\ng\"\n");
  EXPECT_EQ(csv_line({""}), "\"\"\n");
}

TEST(Csv, ReadsRfc4180) {
  const std::vector<CsvRow> expected{{"a", "b"}, {"1", ""}, {"x,\"y\"", "z\r\nw"}, {"", "last"}};
  EXPECT_EQ(rows("a,b\r\n1,\r\n\"x,\"\"y\"\"\",\"z\r\nw\"\n,last"), expected);
  EXPECT_THAT(rows(""), testing::IsEmpty());
}

TEST(Csv, SkipsEmptyLinesAndNotQuotedEmptyCells) {
  EXPECT_EQ(rows("\n\r\na\n\n\"\"\nb\r"), (std::vector<CsvRow>{{"a"}, {""}, {"b"}}));
}

TEST(Csv, ReadsWhatItWrites) {
  const std::vector<CsvRow> written{{"id", "v"}, {"a/b,c#1", "\"\""},    {"", ""},
                                    {""},        {"line\nbreak", "3.5"}, {"\r", " "}};
  std::string text;
  for (const CsvRow& row : written) text += csv_line(row);
  EXPECT_EQ(rows(text), written);
}

TEST(Csv, NamesTheLine) {
  EXPECT_EQ(message([] { rows("a,b\n1,\"2\n3"); }),
            "file.csv: line 2: got a quote that is not closed, expected its end");
  // The quoted cell of line 1 spans two lines, and line 3 is empty.
  EXPECT_EQ(
      message([] { rows("\"a\nb\"\n\n\"c\"d\n"); }),
      "file.csv: line 4: got text after a closing quote, or a lone CR, expected a comma or the line's end");
  EXPECT_THAT(message([] { rows("a\rb\n"); }), testing::HasSubstr("a lone CR"));
}

TEST(CsvTable, FindsColumnsByName) {
  CsvTableReader table("id,later,value\na,x,1.5\nb,y,\n", "t.csv");
  const std::size_t value = table.column("value");
  EXPECT_EQ(table.find_column("later"), 1U);
  EXPECT_EQ(table.find_column("never"), std::nullopt);
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.cell(table.column("id")), "a");
  EXPECT_EQ(table.number(value), 1.5);
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.number(value), std::nullopt);
  EXPECT_FALSE(table.next());
}

TEST(CsvTable, RefusesWhatIsNoTable) {
  EXPECT_EQ(message([] { CsvTableReader("", "t.csv"); }),
            "t.csv: line 0: got an empty file, expected a line that names the columns");
  EXPECT_EQ(message([] { CsvTableReader("id\n", "t.csv").column("value"); }),
            "t.csv: line 1: got no column \"value\", expected one");
  CsvTableReader table("a,b\n1,x\n3\n", "t.csv");
  ASSERT_TRUE(table.next());
  EXPECT_EQ(message([&] { table.number(1); }),
            "t.csv: line 2: got \"x\" for b, expected a number or nothing");
  EXPECT_EQ(message([&] { table.next(); }), "t.csv: line 3: got 1 cells, expected 2");
}

}  // namespace
}  // namespace q3d::manifests
