#include "pipeline/prediction/photographs_config.h"

#include <gtest/gtest.h>

#include <fstream>

#include "pipeline/run/errors.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::prediction {
namespace {

class PhotographsConfig : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& text) const {
    std::ofstream(scratch_.path() / "c.json") << text;
    return scratch_.path() / "c.json";
  }
  testing::ScratchDir scratch_;
};

TEST_F(PhotographsConfig, PhotographsTakeThePlaceOfABuildsDatasets) {
  const auto file = write(R"({
    "datasets": [{"name": "d", "format": "prima", "root": "r", "annotations": "a.json"}],
    "filter": {"datasets": {"d": {"tau_low": 0.02, "tau_high": 0.05}}},
    "network": {"checkpoint": "n.safetensors", "smal_asset": "s.safetensors"}})");
  PhotographOptions options;
  options.min_score = 0.4;
  options.species = "lion";
  const config::BuildConfig config = photographs_config(scratch_.path() / "photos", options, {file});
  ASSERT_EQ(config.datasets.size(), 1U);
  EXPECT_EQ(config.datasets[0].format, "photographs");
  EXPECT_EQ(config.datasets[0].root, scratch_.path() / "photos");
  EXPECT_EQ(config.datasets[0].annotations, ".");
  EXPECT_DOUBLE_EQ(config.datasets[0].min_confidence, 0.4);
  EXPECT_EQ(config.datasets[0].species, "lion");
  EXPECT_EQ(config.network.checkpoint, scratch_.path() / "n.safetensors");
}

TEST_F(PhotographsConfig, AConfigWithoutANetworkIsRefused) {
  EXPECT_THROW(photographs_config(scratch_.path(), {}, {write("{}")}), run::ConfigError);
}

}  // namespace
}  // namespace q3d::pipeline::prediction
