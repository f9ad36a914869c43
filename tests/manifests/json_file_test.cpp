#include "manifests/json_file.h"

#include <gmock/gmock.h>

#include "manifests/atomic_file.h"
#include "manifests/csv_formula.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(JsonFile, RefusesAKeyThatStandsTwice) {
  const testing::ScratchDir scratch;
  const std::filesystem::path file = scratch.path() / "labels.json";
  const auto read = [&](std::string_view text) {
    write_file_atomically(file, text);
    return read_json_file(file);
  };
  EXPECT_THAT([&] { read(R"({"data": [{"bbox": [1], "id": 2, "bbox": [3]}]})"); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr(file.string()), HasSubstr("the key \"bbox\" stands twice in one object"))));
  EXPECT_THAT([&] { read("{\"a\\n\": 1, \"a\\u000a\": 2}"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("the key \"a\\n\" stands twice")));
  EXPECT_EQ(read(R"({"a": {"a": 1}, "b": [{"a": 1}, {"a": 2}]})").size(), 2U);
}

TEST(CsvFormula, KnowsWhatSpreadsheetsCompute) {
  for (const char* cell : {"=cmd|' /C calc'!A0", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1"}) {
    EXPECT_TRUE(looks_like_formula(cell)) << cell;
  }
  for (const char* cell : {"", "dog", "a=b", "3-4", " =1"}) EXPECT_FALSE(looks_like_formula(cell)) << cell;
}

}  // namespace
}  // namespace q3d::manifests
