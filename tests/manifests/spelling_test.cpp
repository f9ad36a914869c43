#include "manifests/spelling.h"

#include <gtest/gtest.h>

namespace q3d::manifests {
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

}  // namespace
}  // namespace q3d::manifests
