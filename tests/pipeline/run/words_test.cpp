#include "pipeline/run/words.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::run {
namespace {

TEST(Counted, ChoosesSingularOrPlural) {
  EXPECT_EQ(counted(0, "shard"), "0 shards");
  EXPECT_EQ(counted(1, "shard"), "1 shard");
  EXPECT_EQ(counted(2, "shard"), "2 shards");
  EXPECT_EQ(counted(2, "entry", "entries"), "2 entries");
}

}  // namespace
}  // namespace q3d::pipeline::run
