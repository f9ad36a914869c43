#include "pipeline/training/settings/training_config.h"

#include <gtest/gtest.h>

#include <fstream>

#include "pipeline/run/errors.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::training::settings {
namespace {

using nlohmann::json;

json good() {
  return json::parse(R"({
    "network": {"initial": "i.safetensors", "encoders": "e.safetensors", "smal_asset": "s.safetensors",
                "priors": "p.safetensors", "device": "cpu", "precision": "bfloat16", "compute_threads": 2},
    "pools": {"animal3d": {"shards": ["a"]}, "ctrlani3d": {"shards": ["b", "c"], "weight": 0.5}},
    "stages": {
      "1": [{"name": "warm-up", "pools": ["animal3d"], "steps": 10, "ief_iterations": 3, "adversarial": true,
             "learning_rate": 0.01, "warm_up_steps": 2, "decay": "none"},
            {"name": "joint", "pools": ["animal3d", "ctrlani3d"], "steps": 20}],
      "3": [{"name": "only", "pools": ["ctrlani3d"], "steps": 5}]},
    "batch": 4, "batch_parts": 2, "feed_ahead": 1, "augment": false, "keypoint_weight": "raw_v",
    "augmentation": {"scale": 0.1, "rotation_deg": 10, "rotation_rate": 0.2, "mirror_rate": 0.5, "shift": 0.01, "colour": 0.3},
    "loss_weights": {"keypoints_3d": 1, "keypoints_2d": 2, "aux_keypoints_2d": 3, "aux_keypoints_3d": 4,
                     "global_orient": 5, "pose": 6, "betas": 7, "contrastive": 8, "adversarial": 9},
    "loss_variant": "official", "weight_decay": 0.1, "largest_gradient_norm": 1, "divergence_factor": 5,
    "seed": 11, "checkpoint_every": 7, "log_every": 3})");
}

TEST(TrainingConfig, ReadsEveryKey) {
  const TrainingConfig config = parse_training_config(good(), "t", "1");
  EXPECT_EQ(config.network.encoders, "e.safetensors");
  EXPECT_EQ(config.network.precision, Precision::bfloat16);
  EXPECT_EQ(config.network.compute_threads, 2);
  ASSERT_EQ(config.phases.size(), 2U);
  const PhaseConfig& warm_up = config.phases[0];
  EXPECT_EQ(warm_up.name, "warm-up");
  EXPECT_EQ(warm_up.steps, 10);
  EXPECT_EQ(warm_up.ief_iterations, 3);
  EXPECT_TRUE(warm_up.adversarial);
  EXPECT_DOUBLE_EQ(warm_up.learning_rate, 0.01);
  EXPECT_EQ(warm_up.warm_up_steps, 2);
  EXPECT_EQ(warm_up.decay, Decay::none);
  ASSERT_EQ(config.phases[1].pools.size(), 2U);
  EXPECT_EQ(config.phases[1].ief_iterations, 1);
  EXPECT_DOUBLE_EQ(config.phases[1].pools[1].weight, 0.5);
  EXPECT_EQ(config.phases[1].pools[1].shards.size(), 2U);
  EXPECT_EQ(config.feed.batch, 4);
  EXPECT_EQ(config.batch_parts, 2);
  EXPECT_FALSE(config.feed.augment);
  EXPECT_EQ(config.feed.keypoint_weight, feed::KeypointWeight::raw_v);
  EXPECT_DOUBLE_EQ(config.feed.augmentation.colour, 0.3);
  EXPECT_DOUBLE_EQ(config.loss_weights.contrastive, 8.0);
  EXPECT_EQ(config.loss_variant, model::settings::LossVariant::official);
  EXPECT_DOUBLE_EQ(config.divergence_factor, 5.0);
  EXPECT_EQ(config.seed, 11U);
  EXPECT_EQ(config.checkpoint_every, 7);
  EXPECT_EQ(parse_training_config(good(), "t", "3").phases[0].name, "only");
}

TEST(TrainingConfig, DefaultsAreTheOfficialOnes) {
  json config = good();
  for (const char* key : {"batch", "augmentation", "loss_weights", "loss_variant", "weight_decay", "augment",
                          "keypoint_weight", "largest_gradient_norm"}) {
    config.erase(key);
  }
  const TrainingConfig parsed = parse_training_config(config, "t", "1");
  EXPECT_EQ(parsed.feed.batch, 48);
  EXPECT_TRUE(parsed.feed.augment);
  EXPECT_DOUBLE_EQ(parsed.feed.augmentation.rotation_rate, 0.6);
  EXPECT_DOUBLE_EQ(parsed.loss_weights.keypoints_3d, 0.05);
  EXPECT_DOUBLE_EQ(parsed.weight_decay, 1e-4);
  EXPECT_DOUBLE_EQ(parsed.largest_gradient_norm, 0.0);
  EXPECT_DOUBLE_EQ(parsed.phases[1].learning_rate, 3.75e-6);
  EXPECT_EQ(parsed.phases[1].decay, Decay::linear);
  EXPECT_EQ(parsed.loss_variant, model::settings::LossVariant::sound);
}

struct Mutation {
  const char* pointer;
  const char* value;
  const char* expected;  // part of the message
};

class BrokenTrainingConfig : public ::testing::TestWithParam<Mutation> {};

TEST_P(BrokenTrainingConfig, IsRefusedWithTheReason) {
  json config = good();
  config[json::json_pointer(GetParam().pointer)] = json::parse(GetParam().value);
  try {
    parse_training_config(config, "t", "1");
    FAIL() << "accepted " << GetParam().pointer << " = " << GetParam().value;
  } catch (const run::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find(GetParam().expected), std::string::npos) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Keys, BrokenTrainingConfig,
    ::testing::Values(
        Mutation{"/bach", "1", "did you mean \"batch\"?"}, Mutation{"/batch", "0", "1 to 65536"},
        Mutation{"/network/initial", "3", "must be"},
        Mutation{"/network/precision", "\"float16\"", "float32, bfloat16"},
        Mutation{"/network/without", "[\"bio\"]", "bio_features, initial_betas, keypoint_tokens"},
        Mutation{"/network/without", "[]", "at least one"},
        Mutation{"/network/compute_threads", "-1", "at least 0"}, Mutation{"/pools", "{}", "at least one"},
        Mutation{"/pools/animal3d/shards", "[]", "at least one"},
        Mutation{"/pools/animal3d/shards", "[1]", "a list of strings"},
        Mutation{"/pools/animal3d/weight", "-1", "at least 0"},
        Mutation{"/pools/animal3d/wieght", "1", "did you mean \"weight\"?"},
        Mutation{"/stages", "{\"2\": []}", "expected one of: 2"}, Mutation{"/stages/1", "[]", "at least one"},
        Mutation{"/stages/1/0/pools", "[\"anmal3d\"]", "Did you mean \"animal3d\"?"},
        Mutation{"/stages/1/0/steps", "0", "at least 1"},
        Mutation{"/stages/1/0/warm_up_steps", "10", "less than \"steps\""},
        Mutation{"/stages/1/0/ief_iterations", "0", "1 to 16"},
        Mutation{"/stages/1/0/learning_rate", "0", "greater than 0"},
        Mutation{"/stages/1/0/decay", "\"cosine\"", "linear, none"},
        Mutation{"/stages/1/0/stps", "1", "did you mean \"steps\"?"},
        Mutation{"/batch_parts", "0", "1 to 65536"}, Mutation{"/feed_ahead", "-1", "0 to 64"},
        Mutation{"/keypoint_weight", "\"v\"", "label, raw_v"},
        Mutation{"/augmentation/scale", "1", "less than 1"},
        Mutation{"/augmentation/rotation_rate", "2", "0 to 1"},
        Mutation{"/augmentation/mirror_rate", "-0.1", "0 to 1"},
        Mutation{"/augmentation/flip", "true", "unknown key"},
        Mutation{"/loss_weights/pse", "1", "did you mean \"pose\"?"},
        Mutation{"/domain", R"({"trained_on": "x"})", "\"pictures\""},
        Mutation{"/domain", R"({"pictures": "drawn", "trained_on": "x"})", "photographs, rendered"},
        Mutation{"/domain", R"({"pictures": "rendered", "trained_on": "x", "held_out": "anmal3d"})",
                 "Did you mean \"animal3d\"?"},
        Mutation{"/domain", R"({"pictures": "rendered", "trained_on": "x", "samples": 3})", "20 to 1000000"},
        Mutation{"/loss_variant", "\"x\"", "sound, official"}, Mutation{"/weight_decay", "-1", "at least 0"},
        Mutation{"/stem_rate", "-0.1", "at least 0"}, Mutation{"/frozen_stem_blocks", "12", "0 to 11"},
        Mutation{"/frozen_stem_blocks", "-1", "0 to 11"},
        Mutation{"/largest_gradient_norm", "-1", "at least 0"},
        Mutation{"/divergence_factor", "1", "greater than 1"}, Mutation{"/seed", "-1", "seed"},
        Mutation{"/checkpoint_every", "0", "at least 1"}, Mutation{"/log_every", "0", "at least 1"}));

TEST(TrainingConfig, AMissingPartIsNamed) {
  for (const char* key : {"network", "pools", "stages"}) {
    json config = good();
    config.erase(key);
    try {
      parse_training_config(config, "t", "1");
      FAIL() << key;
    } catch (const run::ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(std::string("\"") + key + "\" is missing"), std::string::npos)
          << error.what();
    }
  }
}

TEST(TrainingConfig, MissingPriorsNameTheCommandThatWritesThem) {
  json config = good();
  config["network"].erase("priors");
  try {
    parse_training_config(config, "t", "1");
    FAIL();
  } catch (const run::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("quadruped3d init --priors FILE"), std::string::npos)
        << error.what();
  }
}

TEST(TrainingConfig, SingleKeysAreSetOnTopOfTheFiles) {
  const testing::ScratchDir scratch;
  std::ofstream(scratch.path() / "t.json") << good().dump();
  const TrainingConfig config =
      load_training_config({scratch.path() / "t.json"}, "1", {"seed=9", "pools.animal3d.shards.0=x"});
  EXPECT_EQ(config.seed, 9U);
  EXPECT_EQ(config.phases[0].pools[0].shards[0], std::filesystem::current_path() / "x");
}

TEST(TrainingConfig, PathsAreRelativeToTheirFile) {
  const testing::ScratchDir scratch;
  std::filesystem::create_directories(scratch.path() / "layer");
  std::ofstream(scratch.path() / "base.json") << good().dump();
  std::ofstream(scratch.path() / "layer/top.json") << R"({"pools": {"animal3d": {"shards": ["x"]}}})";
  const TrainingConfig config =
      load_training_config({scratch.path() / "base.json", scratch.path() / "layer/top.json"}, "1");
  EXPECT_EQ(config.network.priors, scratch.path() / "p.safetensors");
  EXPECT_EQ(config.phases[0].pools[0].shards[0], scratch.path() / "layer/x");
  EXPECT_EQ(config.phases[1].pools[1].shards[1], scratch.path() / "c");
}

json deciding(const json& config) {
  return deciding_values(parse_training_config(config, "t", "1"));
}

TEST(DecidingValues, ADefaultCountsAsIfItWereWritten) {
  json config = good();
  const json written = deciding(config);
  config["backbone_rate"] = 0.1;
  config["stages"]["1"][1]["decay"] = "linear";
  config["pools"]["animal3d"]["weight"] = 1.0;
  EXPECT_EQ(deciding(config), written);
}

TEST(DecidingValues, HoldWhatDecidesTheWeights) {
  const json before = deciding(good());
  const std::vector<std::pair<std::string, json>> changes{{"/batch", 8},
                                                          {"/batch_parts", 1},
                                                          {"/augment", true},
                                                          {"/keypoint_weight", "label"},
                                                          {"/augmentation/scale", 0.2},
                                                          {"/loss_weights/pose", 7},
                                                          {"/loss_variant", "sound"},
                                                          {"/backbone_rate", 0.2},
                                                          {"/stem_rate", 0.5},
                                                          {"/frozen_stem_blocks", 4},
                                                          {"/weight_decay", 0.2},
                                                          {"/largest_gradient_norm", 2},
                                                          {"/model_dtype", "float16"},
                                                          {"/seed", 12U},
                                                          {"/network/precision", "auto"},
                                                          {"/network/without", {"bio_features"}},
                                                          {"/pools/ctrlani3d/weight", 0.6},
                                                          {"/stages/1/0/steps", 11},
                                                          {"/stages/1/0/objective", "encoders"},
                                                          {"/stages/1/0/ief_iterations", 2},
                                                          {"/stages/1/0/adversarial", false},
                                                          {"/stages/1/0/learning_rate", 0.02},
                                                          {"/stages/1/0/warm_up_steps", 3},
                                                          {"/stages/1/0/decay", "linear"},
                                                          {"/stages/1/0/pools", {"ctrlani3d"}}};
  for (const auto& [pointer, value] : changes) {
    json config = good();
    config[json::json_pointer(pointer)] = value;
    EXPECT_NE(deciding(config), before) << pointer;
  }
}

TEST(DecidingValues, LeaveOutWhatOnlySteersTheRun) {
  json config = good();
  config["checkpoint_every"] = 8;
  config["log_every"] = 4;
  config["feed_ahead"] = 2;
  config["divergence_factor"] = 6;
  config["network"]["device"] = "auto";
  config["network"]["compute_threads"] = 1;
  config["network"]["initial"] = "elsewhere/i.safetensors";  // its digest decides, not its path
  config["stages"]["3"][0]["steps"] = 6;                     // another stage
  EXPECT_EQ(deciding(config), deciding(good()));
}

}  // namespace
}  // namespace q3d::pipeline::training::settings
