#include "pipeline/run/words.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::run {
namespace {

TEST(NearestWord, ByEditDistance) {
  EXPECT_EQ(nearest_word("superanmal", {"prima", "superanimal", "coco"}), "superanimal");
  EXPECT_EQ(nearest_word("anything", {}), "");
}

TEST(Suggestion, NamesWhatIsProbablyMeant) {
  const std::vector<std::string> commands{"build", "calibrate", "evaluate", "evaluate-labels", "topology"};
  EXPECT_EQ(suggestion("biuld", commands), "; did you mean \"build\"?");
  EXPECT_EQ(suggestion("evalute", commands), "; did you mean \"evaluate\"?");
  EXPECT_EQ(suggestion("topo", commands), "; did you mean \"topology\"?");  // the beginning of it
  EXPECT_EQ(suggestion("xyz", commands), "");
  EXPECT_EQ(suggestion("build", {}), "");
}

TEST(Counted, ChoosesSingularOrPlural) {
  EXPECT_EQ(counted(0, "shard"), "0 shards");
  EXPECT_EQ(counted(1, "shard"), "1 shard");
  EXPECT_EQ(counted(2, "shard"), "2 shards");
  EXPECT_EQ(counted(2, "entry", "entries"), "2 entries");
}

}  // namespace
}  // namespace q3d::pipeline::run
