#include "pipeline/config/config_override.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "pipeline/config/build_config.h"
#include "pipeline/config/device_names.h"
#include "pipeline/run/errors.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::config {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kConfig = R"({
  "datasets": [{"name": "a", "format": "prima", "root": "ra", "annotations": "t.json"},
               {"name": "walk", "format": "prima", "root": "rw", "annotations": "t.json"}],
  "network": {"checkpoint": "c.safetensors", "smal_asset": "s.safetensors"},
  "filter": {"tau_low": 0.1, "tau_high": 0.2, "datasets": {"walk": {"delta": 0.3}}}})";

class Overrides : public ::testing::Test {
 protected:
  Overrides() { std::ofstream(file_) << kConfig; }

  BuildConfig load(const std::vector<std::string>& settings) const {
    return load_build_config({file_}, settings);
  }
  std::string refusal(const std::vector<std::string>& settings) const {
    try {
      load(settings);
    } catch (const run::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  }

  testing::ScratchDir scratch_;
  fs::path file_ = scratch_.path() / "c.json";
};

TEST_F(Overrides, ValuesAreJsonWhereTheyParseAndElseTexts) {
  const auto value = [](const std::string& text) { return parse_override("k=" + text).value; };
  EXPECT_EQ(value("2e-6"), json(2e-6));
  EXPECT_EQ(value("true"), json(true));
  EXPECT_EQ(value("\"7\""), json("7"));
  EXPECT_EQ(value("[1, 2]"), json({1, 2}));
  EXPECT_EQ(value("1.0.0"), json("1.0.0"));
  EXPECT_EQ(value("goat=2"), json("goat=2"));
  EXPECT_EQ(value(""), json(""));
  EXPECT_THAT(parse_override("tta.learning_rate=1").keys, ElementsAre("tta", "learning_rate"));
  EXPECT_THAT(parse_override("/filter/datasets/my.set=1").keys, ElementsAre("filter", "datasets", "my.set"));
}

TEST_F(Overrides, ReplaceWhatTheFilesSay) {
  const BuildConfig config = load(
      {"tta.learning_rate=0.5", "filter.tau_low=0.15", "version=2.0.0", "filter.datasets.walk.delta=0.4"});
  EXPECT_DOUBLE_EQ(config.tta.learning_rate, 0.5);  // the object "tta" was not there
  EXPECT_DOUBLE_EQ(*config.filter.tau_low, 0.15);
  EXPECT_DOUBLE_EQ(*config.filter.tau_high, 0.2);
  EXPECT_EQ(config.version, "2.0.0");
  EXPECT_DOUBLE_EQ(*config.filter.datasets.at("walk").delta, 0.4);
  EXPECT_EQ(config.as_written["tta"]["learning_rate"], 0.5);
}

TEST_F(Overrides, ALaterOneReplacesAnEarlierOne) {
  EXPECT_EQ(load({"name=one", "name=two"}).name, "two");
}

TEST_F(Overrides, MembersOfListsGoByNameOrPlace) {
  const BuildConfig config = load({"datasets.walk.split=test", "datasets.0.split=other"});
  EXPECT_EQ(config.datasets[1].split, "test");
  EXPECT_EQ(config.datasets[0].split, "other");
  EXPECT_EQ(config.datasets[1].annotations, "t.json");
}

TEST_F(Overrides, PathsStartFromTheCurrentFolderAndAreRecordedAsWritten) {
  const BuildConfig config = load({"network.checkpoint=other/c.safetensors", "datasets.walk.root=there"});
  EXPECT_EQ(config.network.checkpoint, fs::current_path() / "other/c.safetensors");
  EXPECT_EQ(config.network.smal_asset, scratch_.path() / "s.safetensors");
  EXPECT_EQ(config.datasets[1].root, fs::current_path() / "there");
  EXPECT_EQ(config.datasets[0].root, scratch_.path() / "ra");
  EXPECT_EQ(config.as_written["datasets"][1]["root"], "there");
  EXPECT_EQ(config.as_written["network"]["checkpoint"], "other/c.safetensors");
}

TEST_F(Overrides, ObjectsAreMergedAndNullTakesAKeyAway) {
  const BuildConfig config = load({R"(filter={"tau_high": 0.9})", "filter.datasets=null"});
  EXPECT_DOUBLE_EQ(*config.filter.tau_low, 0.1);
  EXPECT_DOUBLE_EQ(*config.filter.tau_high, 0.9);
  EXPECT_TRUE(config.filter.datasets.empty());
}

TEST_F(Overrides, WhatCannotBeSetIsExplained) {
  EXPECT_THAT(
      refusal({"tta.learning_rte=1"}),
      HasSubstr("c.json + --set: tta: unknown key \"learning_rte\"; did you mean \"learning_rate\"?"));
  EXPECT_THAT(refusal({"tt.learning_rate=1"}), HasSubstr("unknown key \"tt\"; did you mean \"tta\"?"));
  EXPECT_THAT(refusal({"name"}), HasSubstr("--set name: expected KEY=VALUE"));
  EXPECT_THAT(refusal({"=3"}), HasSubstr("expected KEY=VALUE"));
  EXPECT_THAT(refusal({"tta..batch=3"}), HasSubstr("a part of the key is empty"));
  EXPECT_THAT(refusal({"filter.tau_low.x=1"}), HasSubstr("\"x\" leads into 0.1, which holds no keys"));
  EXPECT_THAT(
      refusal({"datasets.wlak.split=x"}),
      HasSubstr("the list has 2 entries, and \"wlak\" is neither the place of one, counted from 0, nor "
                "its \"name\""));
  EXPECT_THAT(refusal({"datasets.2.split=x"}), HasSubstr("the list has 2 entries"));
  EXPECT_THAT(refusal({"tta.batch=many"}), HasSubstr("\"batch\" must be a whole number, got \"many\""));
}

TEST_F(Overrides, DeepValuesAreRefused) {
  EXPECT_THAT(refusal({"tta=" + std::string(40, '[') + std::string(40, ']')}), HasSubstr("beyond 32 levels"));
}

TEST_F(Overrides, OnlyLeakageDoesWithoutANetwork) {
  EXPECT_THAT(refusal({"network=null"}), HasSubstr("the key \"network\" is missing"));
  EXPECT_EQ(load_build_config({file_}, {"network=null"}, NetworkKey::optional).datasets.size(), 2U);
}

TEST(Devices, AreOneOrSeveralNumberedGpus) {
  EXPECT_THAT(parse_devices("auto", "w"), ElementsAre("auto"));
  EXPECT_THAT(parse_devices("cuda:1", "w"), ElementsAre("cuda:1"));
  EXPECT_THAT(parse_devices("cuda:0,cuda:1", "w"), ElementsAre("cuda:0", "cuda:1"));
  for (const char* wrong :
       {"", "gpu", "cuda:", "cuda:x", "cuda:0,", "cpu,cuda:0", "cuda:128", "cuda:0,cuda:0"}) {
    EXPECT_THROW(parse_devices(wrong, "w"), run::ConfigError) << wrong;
  }
}

TEST(Devices, SeveralGpusAreOneForEachRank) {
  require_device_for_each_rank("auto", 3);
  require_device_for_each_rank("cuda:3", 1);
  require_device_for_each_rank("cuda:0,cuda:2", 2);
  for (const int ranks : {1, 3}) {
    EXPECT_THROW(require_device_for_each_rank("cuda:0,cuda:2", ranks), run::ConfigError) << ranks;
  }
  EXPECT_EQ(device_of_rank("cuda:0,cuda:2", 0), "cuda:0");
  EXPECT_EQ(device_of_rank("cuda:0,cuda:2", 1), "cuda:2");
  EXPECT_EQ(device_of_rank("auto", 1), "auto");
}

TEST_F(Overrides, AMisspeltDeviceIsRefused) {
  EXPECT_EQ(load({"network.device=cuda:3"}).network.device, "cuda:3");
  EXPECT_THAT(refusal({"network.device=gpu"}), HasSubstr("expected auto, cpu, cuda, cuda:I"));
}

}  // namespace
}  // namespace q3d::pipeline::config
