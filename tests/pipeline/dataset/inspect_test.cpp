#include "pipeline/dataset/inspect.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <stdexcept>

#include "tests/pipeline/dataset/made_dataset.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::dataset {
namespace {

using ::testing::HasSubstr;

class Inspect : public ::testing::Test {
 protected:
  q3d::testing::ScratchDir folder_;
  std::filesystem::path version_ = make_dataset(folder_.path());
};

TEST_F(Inspect, ThePageFitsAScreenAndHasNoJson) {
  const std::string text = page(folder_.path());
  EXPECT_LT(std::count(text.begin(), text.end(), '\n'), 60);
  EXPECT_EQ(text.find('{'), std::string::npos);
  EXPECT_THAT(text, HasSubstr("made 1.0.0 (made-0123456789ab)"));
}

TEST_F(Inspect, ThePageHasCountsReasonsGroupsThresholdsAndPlaces) {
  const std::string text = page(version_);
  EXPECT_THAT(text, HasSubstr("4 candidates\n         2   50.0 %  retained "));
  EXPECT_THAT(text, HasSubstr("         1   25.0 %  image_empty             The picture's file is empty.\n"));
  EXPECT_THAT(text, HasSubstr("         2  100.0 %  2d_only "));
  EXPECT_THAT(text, HasSubstr("  zoo/train                         3        2   66.7 %\n"));
  EXPECT_THAT(text, HasSubstr("  bovidae                           1        0    0.0 %\n"));
  EXPECT_THAT(text, HasSubstr("pool: tau_low 0.0400, tau_high 0.0800, delta 0.05"));
  EXPECT_THAT(text, HasSubstr("checkpoint with SHA-256 cccc"));
  EXPECT_THAT(text, HasSubstr(" verify " + version_.string()));
}

TEST_F(Inspect, AShardAndASampleHavePagesToo) {
  EXPECT_THAT(page(version_ / "shards/000001.h5"), HasSubstr("    zoo/train/d.jpg#3\n"));
  for (const auto& path : {version_, version_ / "shards/000000.h5"}) {
    EXPECT_THAT(sample_page(path, "zoo/train/a.jpg#0"),
                ::testing::AllOf(HasSubstr("2d_only. The sample has annotated keypoints and no body."),
                                 HasSubstr("1 of 26 are visible"), HasSubstr("p.jpg, 64 x 48 px")));
    EXPECT_EQ(describe_sample(path, "zoo/train/a.jpg#0").at("record").at("id"), "zoo/train/a.jpg#0");
  }
}

TEST_F(Inspect, NamesTheKeypointsInTheOrderOfTheArrays) {
  for (const auto& path : {version_, version_ / "shards/000001.h5"}) {
    EXPECT_THAT(page(path), HasSubstr("\n   0  left_eye, right_eye, chin, left_front_paw, "));
    EXPECT_THAT(page(path), HasSubstr("nose, tail_mid\n"));
    const auto names = describe(path).at("keypoint_names").get<std::vector<std::string>>();
    ASSERT_EQ(names.size(), 26U);
    EXPECT_EQ(names[3], "left_front_paw");
    EXPECT_EQ(names[25], "tail_mid");
  }
}

TEST_F(Inspect, ASampleIsFoundByAPartOfItsId) {
  for (const auto& path : {version_, version_ / "shards/000000.h5"}) {
    EXPECT_EQ(describe_sample(path, "a.jpg").at("record").at("id"), "zoo/train/a.jpg#0");
    EXPECT_THAT(sample_page(path, "a.jpg"), HasSubstr("zoo/train/a.jpg#0\n"));
    EXPECT_THROW(describe_sample(path, "nobody"), std::runtime_error);
  }
}

TEST_F(Inspect, ASampleWithoutALabelIsNamedWithItsReason) {
  try {
    find_sample(version_, "pool/test/c.jpg#2");
    FAIL() << "nothing thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("discarded (error_too_large)"));
  }
}

TEST_F(Inspect, SamplesAreSpreadOverTheShards) {
  const auto both = spread_samples(version_, 5);
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[1].record.id, "zoo/train/d.jpg#3");
  EXPECT_EQ(spread_samples(version_ / "shards/000001.h5", 1)[0].record.id, "zoo/train/d.jpg#3");
}

}  // namespace
}  // namespace q3d::pipeline::dataset
