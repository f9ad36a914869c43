#include "pipeline/config/build_config.h"

#include <gtest/gtest.h>

#include <fstream>

#include "pipeline/config/effective_config.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/config/profiles.h"
#include "pipeline/run/errors.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json good() {
  return json::parse(R"({
    "name": "q", "version": "1.2.3",
    "datasets": [{"name": "a", "format": "prima", "root": "r", "annotations": "train.json", "split": "train"}],
    "network": {"checkpoint": "c.safetensors", "smal_asset": "s.safetensors", "device": "cpu", "dtype": "float32",
                "batch": 4, "compute_threads": 1},
    "tta": {"objective": "demo", "learning_rate": 0.001, "aux_weight": 1, "reproj_weight": 2, "iterations_min": 5,
            "iterations_max": 6, "batch": 3},
    "filter": {"tau_low": 0.1, "tau_high": 0.2, "delta": 0.03},
    "guards": {"visible_min": 5, "iterations_full_at": 12, "held_out_share": 0.25, "held_out_seed": 7,
               "held_out_patience": 4, "pose_deviation_max": 3, "limb_factor_max": 1.5, "left_right_max": 1.25,
               "mask_iou_min": 0.4, "priors": "p.safetensors"},
    "shards": {"unit_size": 10, "images": "png", "jpeg_quality": 90, "crop_scale": 2, "crop_min_side_px": 300},
    "calibrate": {"retained": 0.5, "refined": 0.25, "per_dataset": true}})");
}

TEST(BuildConfig, ReadsEveryKey) {
  const BuildConfig config = parse_build_config(good(), "t");
  EXPECT_EQ(config.name, "q");
  EXPECT_EQ(config.version, "1.2.3");
  ASSERT_EQ(config.datasets.size(), 1U);
  EXPECT_EQ(config.datasets[0].format, "prima");
  EXPECT_EQ(config.datasets[0].split, "train");
  EXPECT_EQ(config.network.batch, 4);
  EXPECT_EQ(config.network.compute_threads, 1);
  EXPECT_EQ(config.tta.objective, TtaObjective::demo);
  EXPECT_EQ(config.tta.iterations_max, 6);
  EXPECT_EQ(config.shards.images, manifests::ImageEncoding::png);
  EXPECT_DOUBLE_EQ(config.shards.crop_scale, 2.0);
  EXPECT_DOUBLE_EQ(config.calibrate.refined, 0.25);
  EXPECT_TRUE(config.calibrate.per_dataset);
  EXPECT_EQ(config.profile, "paper");
  EXPECT_EQ(config.guards.visible_min, 5);
  EXPECT_EQ(config.guards.iterations_full_at, 12);
  EXPECT_DOUBLE_EQ(config.guards.held_out_share, 0.25);
  EXPECT_EQ(config.guards.held_out_seed, 7U);
  EXPECT_EQ(config.guards.held_out_patience, 4);
  EXPECT_DOUBLE_EQ(config.guards.pose_deviation_max, 3.0);
  EXPECT_DOUBLE_EQ(config.guards.limb_factor_max, 1.5);
  EXPECT_DOUBLE_EQ(config.guards.left_right_max, 1.25);
  EXPECT_DOUBLE_EQ(config.guards.mask_iou_min, 0.4);
  EXPECT_EQ(config.guards.priors, "p.safetensors");
  const filters::Thresholds limits = judging_rules(config).of("a");
  EXPECT_DOUBLE_EQ(limits.tau_low, 0.1);
  EXPECT_DOUBLE_EQ(limits.tau_high, 0.2);
  EXPECT_DOUBLE_EQ(limits.delta, 0.03);
  EXPECT_EQ(limits.iterations_min, 5);
}

json own_labels() {
  return json::parse(R"({"name": "lab", "format": "deeplabcut", "root": "r", "annotations": "labeled-data",
    "topology": "goats.json", "species": "goat", "min_confidence": 0.25, "box_margin": 0.5})");
}

TEST(BuildConfig, ReadsLabelsOfOnesOwn) {
  json document = good();
  document["datasets"][0] = own_labels();
  const DatasetConfig dataset = parse_build_config(document, "t").datasets[0];
  EXPECT_EQ(dataset.topology, "goats.json");
  EXPECT_EQ(dataset.species, "goat");
  EXPECT_DOUBLE_EQ(dataset.min_confidence, 0.25);
  EXPECT_DOUBLE_EQ(dataset.box_margin, 0.5);
  for (const char* key : {"min_confidence", "box_margin", "species"}) document["datasets"][0].erase(key);
  const DatasetConfig plain = parse_build_config(document, "t").datasets[0];
  EXPECT_DOUBLE_EQ(plain.min_confidence, 0.6);
  EXPECT_DOUBLE_EQ(plain.box_margin, 0.1);
}

TEST(BuildConfig, ReadsWhatIsToBeLeftOut) {
  json document = good();
  EXPECT_FALSE(parse_build_config(document, "t").leakage);
  document["veto"] = "list.txt";
  document["leakage"] = {{"test_sets", document["datasets"]}, {"max_distance", 3}};
  const BuildConfig config = parse_build_config(document, "t");
  EXPECT_EQ(config.veto, "list.txt");
  ASSERT_TRUE(config.leakage);
  EXPECT_EQ(config.leakage->max_distance, 3);
  ASSERT_EQ(config.leakage->test_sets.size(), 1U);
  EXPECT_EQ(config.leakage->test_sets[0].name, "a");
}

TEST(BuildConfig, EveryPathIsRelativeToItsFile) {
  const testing::ScratchDir scratch;
  json document = good();
  document["datasets"][0] = own_labels();
  document["datasets"][0]["curation"] = "chosen.csv";
  document["datasets"].push_back({{"name", "truth"},
                                  {"format", "prima"},
                                  {"root", "r"},
                                  {"annotations", "t"},
                                  {"role", "truth"},
                                  {"body_model", "smal.safetensors"},
                                  {"keypoints_3d", "body"}});
  document["veto"] = "list.txt";
  document["leakage"] = {{"test_sets", document["datasets"]}};
  std::ofstream(scratch.path() / "c.json") << document;
  const BuildConfig config = load_build_config({scratch.path() / "c.json"});
  EXPECT_EQ(config.veto, scratch.path() / "list.txt");
  EXPECT_EQ(config.datasets[0].topology, scratch.path() / "goats.json");
  EXPECT_EQ(config.datasets[0].curation, scratch.path() / "chosen.csv");
  EXPECT_EQ(config.datasets.back().body_model, scratch.path() / "smal.safetensors");
  EXPECT_TRUE(config.datasets.back().keypoints_3d_of_body);
  EXPECT_EQ(config.leakage->test_sets[0].root, scratch.path() / "r");
  EXPECT_EQ(config.as_written["veto"], "list.txt");
}

TEST(BuildConfig, RefusesWhatLabelsOfOnesOwnCannotHave) {
  const auto refusal = [](const char* key, const json& value) -> std::string {
    json document = good();
    document["datasets"][0] = own_labels();
    if (value.is_null()) {
      document["datasets"][0].erase(key);
    } else {
      document["datasets"][0][key] = value;
    }
    try {
      parse_build_config(document, "t");
    } catch (const run::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_NE(refusal("topology", nullptr).find("\"topology\" is missing"), std::string::npos);
  EXPECT_NE(refusal("min_confidence", 1.5).find("must be 0 to 1"), std::string::npos);
  EXPECT_NE(refusal("box_margin", -1).find("must be 0 to 2"), std::string::npos);
  EXPECT_NE(refusal("format", "superanimal").find("\"topology\" belongs to the formats whose keypoints"),
            std::string::npos);
  EXPECT_NE(refusal("min_confidense", 0.5).find("did you mean \"min_confidence\""), std::string::npos);
}

// One good config, broken one key at a time.
TEST(BuildConfig, ANameMustFitIntoAFolder) {
  json config = good();
  config["name"] = std::string(200, 'n');
  EXPECT_EQ(parse_build_config(config, "t").name.size(), 200U);
  config["name"] = std::string(201, 'n');
  EXPECT_THROW(parse_build_config(config, "t"), run::ConfigError);
}

struct Mutation {
  const char* pointer;
  const char* value;
  const char* expected;  // part of the message
};

class BrokenConfig : public ::testing::TestWithParam<Mutation> {};

TEST_P(BrokenConfig, IsRefusedWithTheReason) {
  json config = good();
  config[json::json_pointer(GetParam().pointer)] = json::parse(GetParam().value);
  try {
    judging_rules(parse_build_config(config, "t"));
    FAIL() << "accepted " << GetParam().pointer << " = " << GetParam().value;
  } catch (const run::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find(GetParam().expected), std::string::npos) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Keys, BrokenConfig,
    ::testing::Values(
        Mutation{"/nmae", "1", "did you mean \"name\"?"},
        Mutation{"/netwrok", "{}", "did you mean \"network\"?"},
        Mutation{"/datsets", "[]", "did you mean \"datasets\"?"},
        Mutation{"/veto", "3", "\"veto\" must be a string"},
        Mutation{"/leakage", "{}", "\"test_sets\" must name at least one dataset"},
        Mutation{"/leakage", "{\"test_sets\": 3}", "must be a list of objects"},
        Mutation{"/leakage", "{\"test_sets\": [{\"name\": \"b\"}]}", "leakage: test_sets[0]"},
        Mutation{
            "/leakage",
            "{\"test_sets\": [{\"name\": \"b\", \"format\": \"prima\", \"root\": \"r\", \"annotations\": "
            "\"t\"}], \"max_distance\": 16}",
            "\"max_distance\" must be 0 to 15"},
        Mutation{"/name", "\"a/b\"", "becomes a folder"},
        Mutation{"/version", "\"1\"", "must look like 1.0.0"},
        Mutation{"/version", "\"1..0\"", "must look like 1.0.0"},
        Mutation{"/version", "\"1.0.0.0\"", "must look like 1.0.0"},
        Mutation{"/version", "\"1.0.\"", "must look like 1.0.0"},
        Mutation{"/version", "\"1.0.x\"", "must look like 1.0.0"},
        Mutation{"/datasets", "[]", "at least one dataset"}, Mutation{"/datasets", "{}", "must be a list"},
        Mutation{"/datasets/0/format", "\"prma\"", "Did you mean \"prima\"?"},
        Mutation{"/datasets/0/body_model", "\"smal.safetensors\"", "needs \"role\": \"truth\""},
        Mutation{"/datasets/0/keypoints_3d", "\"body\"", "needs a \"body_model\""},
        Mutation{"/datasets/0/keypoints_3d", "\"bdy\"", "file, body"},
        Mutation{"/datasets/0/rot", "\"x\"", "did you mean \"root\"?"},
        Mutation{"/datasets/0/name", "\"../x\"", "letters, digits"},
        Mutation{"/datasets/0/max_picture_megapixels", "0", "max_picture_megapixels"},
        Mutation{"/datasets/0/max_picture_megapixels", "201", "max_picture_megapixels"},
        Mutation{"/max_failed_share", "1.1", "max_failed_share"},
        Mutation{"/datasets/0/role", "\"truht\"", "Did you mean \"truth\"?"},
        Mutation{"/network/dtype", "\"float16\"", "float32, bfloat16"},
        Mutation{"/network/batch", "0", "at least 1"},
        Mutation{"/network/compute_threads", "-1", "must be at least 0"},
        Mutation{"/tta/objective", "\"papr\"", "Did you mean \"paper\"?"},
        Mutation{"/tta/learning_rate", "0", "greater than 0"},
        Mutation{"/tta/iterations_min", "7", "iterations_min <= iterations_max"},
        Mutation{"/tta/batch", "0", "at least 1"}, Mutation{"/filter/tau_low", "0.3", "filter: "},
        Mutation{"/filter/delta", "\"x\"", "must be a number"},
        Mutation{"/shards/unit_size", "0", "1 to 65536"},
        Mutation{"/shards/images", "\"gif\"", "jpeg, png, reference"},
        Mutation{"/shards/jpeg_quality", "101", "1 to 100"}, Mutation{"/shards/crop_scale", "0.5", "1 to 4"},
        Mutation{"/shards/crop_min_side_px", "100", "256 to 2048"},
        Mutation{"/calibrate/retained", "0.9", "sum less than 1"},
        Mutation{"/profile", "\"strit\"", "Did you mean \"strict\"?"},
        Mutation{"/guards/visible_mn", "1", "did you mean \"visible_min\"?"},
        Mutation{"/guards/visible_min", "27", "must be 0 to 26"},
        Mutation{"/guards/iterations_full_at", "27", "must be 0 to 26"},
        Mutation{"/guards/held_out_share", "1", "less than 1"},
        Mutation{"/guards/held_out_patience", "-1", "must be at least 0"},
        Mutation{"/guards/mask_iou_min", "1.1", "must be 0 to 1"},
        Mutation{"/guards/limb_factor_max", "-1", "must be at least 0"},
        Mutation{"/filter/datasets", R"({"b": {"tau_low": 0.1, "tau_high": 0.2}})", "Did you mean \"a\"?"},
        Mutation{"/filter/datasets", R"({"a": {"tau_low": 0.1}})", "belong together"},
        Mutation{"/filter/datasets", R"({"a": {"tau_hgh": 0.1}})", "did you mean \"tau_high\"?"},
        Mutation{"/filter/datasets", R"({"a": {"tau_low": 0.3, "tau_high": 0.2}})", "dataset a"},
        Mutation{"/filter/datasets", "[1]", "a dataset's name for each key"}));

// The misspelt key is named, not only the one that is missing because of it.
TEST(BuildConfig, AMisspeltKeyIsNamedWhereAnotherIsMissing) {
  const auto refusal = [](const json& document) -> std::string {
    try {
      parse_build_config(document, "t");
    } catch (const run::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  for (const auto& [key, misspelt] : {std::pair("datasets", "dataset"), std::pair("network", "netwrok")}) {
    json document = good();
    document[misspelt] = document[key];
    document.erase(key);
    const std::string text = refusal(document);
    EXPECT_NE(text.find(std::string("unknown key \"") + misspelt + "\"; did you mean \"" + key + "\"?"),
              std::string::npos)
        << text;
  }
  json document = good();
  document["network"]["checkpont"] = document["network"]["checkpoint"];
  document["network"].erase("checkpoint");
  EXPECT_NE(refusal(document).find("\"checkpont\" is not known: did you mean \"checkpoint\"?"),
            std::string::npos)
      << refusal(document);
}

TEST(BuildConfig, EveryUnknownKeyIsToldAtOnce) {
  json document = good();
  document["shards"]["jpeg_qualty"] = 1;
  document["shards"]["imags"] = 1;
  try {
    parse_build_config(document, "t");
    FAIL();
  } catch (const run::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("jpeg_quality"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("\"images\""), std::string::npos) << error.what();
  }
}

TEST(BuildConfig, OneTauAloneIsRefused) {
  json config = good();
  config["filter"].erase("tau_high");
  EXPECT_THROW(parse_build_config(config, "t"), run::ConfigError);
}

TEST(BuildConfig, WithoutThresholdsItNamesCalibrate) {
  json config = good();
  config.erase("filter");
  const BuildConfig parsed = parse_build_config(config, "t");
  try {
    judging_rules(parsed);
    FAIL();
  } catch (const run::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("quadruped3d calibrate"), std::string::npos);
  }
}

TEST(BuildConfig, DatasetsThatBringTheirLabelsNeedNoNetwork) {
  json config = good();
  EXPECT_EQ(parse_build_config(config, "t").datasets[0].role, Role::pseudo);
  EXPECT_TRUE(needs_network(parse_build_config(config, "t")));
  config.erase("network");
  config.erase("filter");
  EXPECT_THROW(parse_build_config(config, "t"), run::ConfigError);
  config["datasets"][0]["role"] = "truth";
  EXPECT_EQ(parse_build_config(config, "t").datasets[0].role, Role::truth);
  EXPECT_FALSE(needs_network(parse_build_config(config, "t")));
  config["datasets"][0]["role"] = "2d_only";
  EXPECT_EQ(parse_build_config(config, "t").datasets[0].role, Role::two_d_only);
  config["datasets"].push_back(good()["datasets"][0]);  // one that needs the network is enough
  config["datasets"][1]["name"] = "b";
  EXPECT_THROW(parse_build_config(config, "t"), run::ConfigError);
  config["network"] = good()["network"];
  EXPECT_TRUE(needs_network(parse_build_config(config, "t")));
}

TEST(BuildConfig, TruthIsRefusedWhereTheFormatHasNoBodies) {
  json config = good();
  config["datasets"][0]["role"] = "truth";
  config["datasets"][0]["format"] = "superanimal";
  try {
    parse_build_config(config, "t");
    FAIL();
  } catch (const run::ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("2d_only"), std::string::npos) << error.what();
  }
}

TEST(BuildConfig, TheShippedConfigsOfTheWorldAreSound) {
  const std::filesystem::path configs = testing::data_dir() / "../../configs";
  for (const char* pool : {"animal3d", "ctrlani3d", "superanimal", "held_out"}) {
    const BuildConfig config = load_build_config({configs / "world_pools" / (std::string(pool) + ".json")});
    EXPECT_FALSE(needs_network(config)) << pool;
    EXPECT_EQ(std::filesystem::weakly_canonical(config.datasets[0].root.parent_path()),
              std::filesystem::weakly_canonical(configs / "../data/world"))
        << pool;
  }
  EXPECT_TRUE(needs_network(load_build_config({configs / "world_stage2.json"})));
  const BuildConfig strict =
      load_build_config({configs / "world_stage2.json", configs / "world_strict.json"});
  EXPECT_EQ(strict.profile, "strict");
  EXPECT_TRUE(strict.tta.refine_retained);
  EXPECT_EQ(std::filesystem::weakly_canonical(strict.guards.priors.parent_path()),
            std::filesystem::weakly_canonical(configs / "../data/world/assets"));
}

TEST(BuildConfig, TwoDatasetsOfOneNameAndSplitAreRefused) {
  json config = good();
  config["datasets"].push_back(config["datasets"][0]);
  EXPECT_THROW(parse_build_config(config, "t"), run::ConfigError);
}

TEST(BuildConfig, LayersAndPathsRelativeToTheirFile) {
  const testing::ScratchDir scratch;
  std::filesystem::create_directories(scratch.path() / "layer");
  json base = good();
  base.erase("filter");
  std::ofstream(scratch.path() / "base.json") << base.dump();
  std::ofstream(scratch.path() / "layer/top.json")
      << R"({"filter": {"tau_low": 0.3, "tau_high": 0.4}, "network": {"checkpoint": "other.safetensors"}})";
  const BuildConfig config =
      load_build_config({scratch.path() / "base.json", scratch.path() / "layer/top.json"});
  EXPECT_DOUBLE_EQ(*config.filter.tau_low, 0.3);
  EXPECT_EQ(config.network.checkpoint, scratch.path() / "layer/other.safetensors");
  EXPECT_EQ(config.network.smal_asset, scratch.path() / "s.safetensors");
  EXPECT_EQ(config.datasets[0].root, scratch.path() / "r");
  EXPECT_EQ(config.as_written["network"]["smal_asset"],
            "s.safetensors");  // no path of this machine is recorded
}

TEST(BuildConfig, LongTextsAndDeepNestingAreRefusedWithoutRecursion) {
  json config = good();
  config["corrections"] = std::string(1'000'000, 'a');
  EXPECT_NO_THROW(parse_build_config(config, "t"));
  config["version"] = std::string(1'000'000, '1');
  EXPECT_THROW(parse_build_config(config, "t"), run::ConfigError);
  const testing::ScratchDir scratch;
  const fs::path file = scratch.path() / "deep.json";
  for (const auto& [open, close] : {std::pair("{\"tta\":", "}"), std::pair("[", "]")}) {
    std::string text = "{\"tta\": ";
    for (int i = 0; i < 200'000; ++i) text += open;
    text += "1";
    for (int i = 0; i < 200'000; ++i) text += close;
    std::ofstream(file) << text + "}";
    try {
      load_build_config({file});
      FAIL();
    } catch (const run::ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find("beyond 32 levels"), std::string::npos) << error.what();
    }
  }
}

TEST(BuildConfig, BrokenJsonNamesTheFile) {
  const testing::ScratchDir scratch;
  for (const char* text : {R"({"name": "q", "datasets": [)", R"({"tta": {"learning_rate": 1e999}})"}) {
    std::ofstream(scratch.path() / "cut.json") << text;
    try {
      load_build_config({scratch.path() / "cut.json"});
      FAIL() << text;
    } catch (const run::ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find("cut.json: not valid JSON"), std::string::npos)
          << error.what();
    }
  }
}

json two_datasets() {
  json config = good();
  config["datasets"].push_back(config["datasets"][0]);
  config["datasets"][1]["name"] = "b";
  return config;
}

TEST(JudgingRules, ADatasetsOwnThresholdsComeBeforeTheCommonOnes) {
  json config = two_datasets();
  config["filter"]["datasets"]["b"] = {{"tau_low", 0.15}, {"tau_high", 0.5}};
  JudgingRules rules = judging_rules(parse_build_config(config, "t"));
  EXPECT_DOUBLE_EQ(rules.of("a").tau_low, 0.1);
  EXPECT_DOUBLE_EQ(rules.of("b").tau_low, 0.15);
  EXPECT_DOUBLE_EQ(rules.of("b").tau_high, 0.5);
  EXPECT_DOUBLE_EQ(rules.of("b").delta, 0.03);
  config["filter"]["datasets"]["b"] = {{"delta", 0.2}};
  rules = judging_rules(parse_build_config(config, "t"));
  EXPECT_DOUBLE_EQ(rules.of("b").tau_low, 0.1);
  EXPECT_DOUBLE_EQ(rules.of("b").delta, 0.2);
  EXPECT_DOUBLE_EQ(rules.of("a").delta, 0.03);
}

TEST(JudgingRules, ADatasetWithoutAnyIsNamed) {
  json config = two_datasets();
  config["filter"] = {{"datasets", {{"a", {{"tau_low", 0.1}, {"tau_high", 0.2}}}}}};
  try {
    judging_rules(parse_build_config(config, "t"));
    FAIL();
  } catch (const run::ConfigError& error) {
    const std::string what = error.what();
    EXPECT_NE(what.find("the dataset b has no thresholds"), std::string::npos) << what;
    EXPECT_NE(what.find("quadruped3d calibrate"), std::string::npos) << what;
  }
  config["datasets"][1]["role"] = "2d_only";  // brings its labels
  EXPECT_EQ(judging_rules(parse_build_config(config, "t")).thresholds.size(), 1U);
}

TEST(Profiles, PaperIsTheRuleAloneAndTheDefault) {
  json config = good();
  config.erase("guards");
  const BuildConfig paper = parse_build_config(config, "t");
  EXPECT_EQ(paper.profile, "paper");
  EXPECT_EQ(paper.guards.visible_min, 0);
  EXPECT_EQ(paper.guards.pose_deviation_max, 0.0);
  EXPECT_EQ(paper.guards.limb_factor_max, 0.0);
  EXPECT_EQ(paper.guards.left_right_max, 0.0);
  EXPECT_EQ(paper.guards.mask_iou_min, 0.0);
  EXPECT_EQ(judging_rules(paper).min_trust, 0.0);
  EXPECT_EQ(paper.guards.iterations_full_at, 0);
  EXPECT_EQ(paper.guards.held_out_share, 0.0);
  config["profile"] = "paper";
  EXPECT_EQ(effective_config(parse_build_config(config, "t")), effective_config(paper));
}

TEST(Profiles, StrictRefinesAllAndTheConfigIsLaidOverIt) {
  json config = good();
  config["profile"] = "strict";
  config["tta"]["batch"] = 3;
  const BuildConfig strict = parse_build_config(config, "t");
  EXPECT_EQ(strict.profile, "strict");
  EXPECT_TRUE(strict.tta.refine_retained);
  EXPECT_GT(strict.tta.pose_prior_weight, 0.0);
  EXPECT_EQ(strict.tta.batch, 3) << "what the config says stays";
  EXPECT_EQ(judging_rules(strict).min_trust,
            profile_layer("strict").at("filter").at("min_trust").get<double>());
  config["tta"]["refine_retained"] = false;
  config["filter"]["min_trust"] = 0.25;
  const BuildConfig overlaid = parse_build_config(config, "t");
  EXPECT_FALSE(overlaid.tta.refine_retained);
  EXPECT_EQ(judging_rules(overlaid).min_trust, 0.25);
}

TEST(EffectiveConfig, SaysEverythingAndReadsAsTheSameConfig) {
  json config = two_datasets();
  config["profile"] = "strict";
  config["filter"]["datasets"]["b"] = {{"delta", 0.2}};
  const auto effective = effective_config(parse_build_config(config, "t"));
  EXPECT_EQ(effective["tta"]["refine_retained"], true);
  EXPECT_EQ(effective["filter"]["datasets"]["b"]["delta"], 0.2);
  EXPECT_EQ(effective["network"]["batch"], 4);
  const json again = json::parse(effective.dump());
  EXPECT_EQ(effective_config(parse_build_config(again, "t")), effective);
  json small = good();
  for (const char* key : {"network", "filter", "guards", "tta", "shards", "calibrate"}) small.erase(key);
  small["datasets"][0]["role"] = "2d_only";
  const auto defaults = effective_config(parse_build_config(small, "t"));
  EXPECT_EQ(defaults["guards"]["held_out_share"], 0.0);
  EXPECT_EQ(defaults["shards"]["unit_size"], 512);
  EXPECT_FALSE(defaults.contains("network"));
}

}  // namespace
}  // namespace q3d::pipeline::config
