#include "pipeline/evaluation/evaluation_config.h"

#include <gtest/gtest.h>

#include <fstream>

#include "pipeline/run/errors.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::evaluation {
namespace {

using nlohmann::json;

class EvaluationConfigFile : public ::testing::Test {
 protected:
  EvaluationConfig load(const json& document, const std::filesystem::path& checkpoint = {}) const {
    std::ofstream(scratch_.path() / "c.json") << document.dump();
    return load_evaluation_config({scratch_.path() / "c.json"}, checkpoint);
  }
  static json good() {
    return json::parse(R"({
      "datasets": [
        {"name": "a", "format": "superanimal", "root": "r", "annotations": "t.json", "split": "test",
         "truth": "truth/a.json", "masks": "m"},
        {"name": "b", "format": "prima", "root": "r", "annotations": "t.json", "split": "test"}],
      "network": {"checkpoint": "c.safetensors", "smal_asset": "s.safetensors"},
      "tta": {"learning_rate": 0.001}})");
  }
  void expect_refused(const json& document, const std::string& expected) const {
    try {
      load(document);
      FAIL() << expected;
    } catch (const run::ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(expected), std::string::npos) << error.what();
    }
  }
  testing::ScratchDir scratch_;
};

TEST_F(EvaluationConfigFile, ResolvesPathsAgainstItsFolder) {
  const EvaluationConfig config = load(good());
  ASSERT_EQ(config.datasets.size(), 2U);
  EXPECT_EQ(config.datasets[0].truth, scratch_.path() / "truth/a.json");
  EXPECT_EQ(config.datasets[0].masks, scratch_.path() / "m");
  EXPECT_EQ(config.datasets[0].source.split, "test");
  EXPECT_TRUE(config.datasets[1].truth.empty());
  EXPECT_EQ(config.network.checkpoint, scratch_.path() / "c.safetensors");
  EXPECT_DOUBLE_EQ(config.tta.learning_rate, 0.001);
  EXPECT_EQ(config.as_written["datasets"][0]["truth"], "truth/a.json");
}

TEST_F(EvaluationConfigFile, ACheckpointOfTheCommandLineWins) {
  EXPECT_EQ(load(good(), "/else/where.safetensors").network.checkpoint, "/else/where.safetensors");
  json document = good();
  document["network"].erase("checkpoint");
  EXPECT_EQ(load(document, "/else/where.safetensors").network.checkpoint, "/else/where.safetensors");
  expect_refused(document, "checkpoint");
}

TEST_F(EvaluationConfigFile, NamesWhatIsWrong) {
  json document = good();
  document["datasets"][1]["masks"] = "m";
  expect_refused(document, "datasets[1]");
  document = good();
  document["datasets"][0]["truth"] = 3;
  expect_refused(document, "\"truth\" must be a string");
  document = good();
  document["datasets"][0]["trth"] = "x";
  expect_refused(document, "unknown key \"trth\"");
  document = good();
  document.erase("network");
  document["datasets"] = {document["datasets"][1]};
  document["datasets"][0]["role"] = "truth";
  expect_refused(document, "no network to evaluate");
  document = good();
  document["network"] = "small";
  expect_refused(document, "network");
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
