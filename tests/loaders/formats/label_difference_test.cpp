// The same labels in two files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "loaders/formats/label_table.h"

namespace q3d::loaders::formats {
namespace {

using ::testing::HasSubstr;

// Two keypoints of one animal in the rows named.
LabelTable table(const std::vector<std::string>& rows) {
  LabelTable made;
  for (const char* bodypart : {"nose", "tail"}) {
    for (const char* coordinate : {"x", "y"}) made.columns.push_back({"Ada", "", bodypart, coordinate});
  }
  made.rows = rows;
  for (std::size_t i = 0; i < rows.size() * 4; ++i) made.values.push_back(10.0 * static_cast<double>(i));
  return made;
}

TEST(LabelDifference, rounded_numbers_and_other_orders_are_the_same) {
  const LabelTable one = table({"a.png", "b.png"});
  LabelTable other = table({"a.png", "b.png"});
  EXPECT_EQ(difference_of(one, other), "");
  other.values[1] += 0.4;
  EXPECT_EQ(difference_of(one, other), "");
  LabelTable reversed = one;
  std::swap(reversed.rows[0], reversed.rows[1]);
  for (std::size_t i = 0; i < 4; ++i) std::swap(reversed.values[i], reversed.values[4 + i]);
  for (LabelColumn& column : reversed.columns) column.scorer = "Bo";
  EXPECT_EQ(difference_of(one, reversed), "");
  LabelTable unlabelled = one;
  unlabelled.values[2] = unlabelled.values[3] = std::nan("");
  EXPECT_EQ(difference_of(unlabelled, unlabelled), "");
}

TEST(LabelDifference, names_how_many_and_the_first) {
  const LabelTable one = table({"a.png", "b.png"});
  LabelTable moved = one;
  moved.values[5] = 77.0;
  moved.values[6] = std::nan("");
  EXPECT_EQ(difference_of(one, moved),
            "which differs from it in 2 numbers, first y of nose in b.png: 50 and 77");
  EXPECT_EQ(difference_of(one, table({"a.png"})), "which lacks 1 row, first b.png");
  EXPECT_EQ(difference_of(table({"b.png"}), one), "which has 1 row, first a.png more");
  LabelTable renamed = one;
  renamed.columns[0].bodypart = "snout";
  EXPECT_THAT(difference_of(one, renamed), HasSubstr("in 2 numbers, first x of nose in a.png"));
}

}  // namespace
}  // namespace q3d::loaders::formats
