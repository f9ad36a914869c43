#include "pipeline/evaluation/text_table.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace q3d::pipeline::evaluation {
namespace {

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
