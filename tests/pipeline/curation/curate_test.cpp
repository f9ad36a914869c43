// The tests go from annotation files and a rule to a list, and from the list to the records of a build.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "loaders/keypoints/topology.h"
#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/candidates/configured_dataset.h"
#include "pipeline/candidates/curation_list.h"
#include "pipeline/curation/curate_run.h"
#include "pipeline/run/errors.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::curation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::Contains;
using ::testing::HasSubstr;

class Curate : public ::testing::Test {
 protected:
  struct Named {
    std::string name;
    std::string source;
  };

  fs::path root() const { return scratch_.path() / "set"; }

  // SuperAnimal's form; the pictures are empty files, which nothing here reads.
  void write_set(const std::string& split, const std::vector<Named>& pictures) {
    json document{{"images", json::array()}, {"annotations", json::array()}};
    document["categories"] = {
        {{"id", 1},
         {"name", "superquadruped"},
         {"keypoints", loaders::keypoints::topology("superanimal_quadruped39").keypoints}}};
    std::vector<double> keypoints;
    for (int k = 0; k < 39; ++k) keypoints.insert(keypoints.end(), {20.0 + k, 30.0 + k, 2.0});
    fs::create_directories(root() / "images");
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      document["images"].push_back({{"id", i},
                                    {"file_name", pictures[i].name},
                                    {"width", 200},
                                    {"height", 200},
                                    {"source_dataset", pictures[i].source}});
      document["annotations"].push_back({{"id", i},
                                         {"image_id", i},
                                         {"category_id", 1},
                                         {"bbox", {10, 10, 60, 70}},
                                         {"keypoints", keypoints}});
      std::ofstream(root() / "images" / pictures[i].name) << "";
    }
    std::ofstream(root() / (split + ".json")) << document;
  }

  json dataset(const std::string& split) const {
    return {{"name", "superanimal"},
            {"format", "superanimal"},
            {"root", root().string()},
            {"annotations", split + ".json"},
            {"split", split}};
  }

  json rule() const {
    return {
        {"name", "subset"},
        {"datasets", {dataset("train"), dataset("test")}},
        {"sources", {{{"source", "ap10k"}, {"annotations", {(scratch_.path() / "ap10k.json").string()}}}}},
        {"videos", {"cheetah"}},
        {"species", {{"horse", {"horse"}}, {"cheetah", {"cheetah"}}, {"bear", {"bear"}}}},
        {"pictures", {{"train", 6}, {"test", 3}}},
        {"seed", 5U}};
  }

  void write_all() {
    write_set("train", {{"horse_1_1.jpg", "AwA-Pose"},
                        {"horse_2_2.jpg", "AwA-Pose"},
                        {"horse_3_3.jpg", "AwA-Pose"},
                        {"run_01_4.jpg", "cheetah"},
                        {"run_02_5.jpg", "cheetah"},
                        {"000000000004_6.jpg", "AP-10K"},
                        {"000000000009_7.jpg", "AP-10K"},
                        {"skunk_1_8.jpg", "AwA-Pose"}});
    write_set("test",
              {{"horse_7_1.jpg", "AwA-Pose"}, {"run_03_2.jpg", "cheetah"}, {"horse_8_3.jpg", "AwA-Pose"}});
    const json source = {{"images", {{{"id", 4}, {"file_name", "000000000004.jpg"}}}},
                         {"categories", {{{"id", 21}, {"name", "polar bear"}}}},
                         {"annotations", {{{"image_id", 4}, {"category_id", 21}}}}};
    std::ofstream(scratch_.path() / "ap10k.json") << source;
  }

  CurationSummary run(const json& config) const {
    return run_curate(parse_curation_config(config, "t"), scratch_.path() / "out");
  }

  config::DatasetConfig curated(const std::string& split, const fs::path& list) const {
    json options = dataset(split);
    options["curation"] = list.string();
    return config::parse_datasets(json::array({options}), "t")[0];
  }

  q3d::testing::ScratchDir scratch_;
};

TEST_F(Curate, gives_every_picture_its_verdict) {
  write_all();
  const CurationSummary summary = run(rule());
  EXPECT_EQ(manifests::read_file(summary.list),
            "split,picture,verdict,species,source,clip\n"
            "train,horse_1_1.jpg,chosen,horse,AwA-Pose,\n"
            "train,horse_2_2.jpg,chosen,horse,AwA-Pose,\n"
            "train,horse_3_3.jpg,chosen,horse,AwA-Pose,\n"
            "train,run_01_4.jpg,chosen,cheetah,cheetah,names run\n"
            "train,run_02_5.jpg,chosen,cheetah,cheetah,names run\n"
            "train,000000000004_6.jpg,chosen,bear,AP-10K,\n"
            "train,000000000009_7.jpg,species_unknown,,AP-10K,\n"
            "train,skunk_1_8.jpg,species_not_listed,skunk,AwA-Pose,\n"
            "test,horse_7_1.jpg,chosen,horse,AwA-Pose,\n"
            "test,run_03_2.jpg,clip_in_other_split,cheetah,cheetah,names run\n"
            "test,horse_8_3.jpg,chosen,horse,AwA-Pose,\n");
  EXPECT_EQ(summary.verdicts.at("train").at("chosen"), 6);
  EXPECT_EQ(summary.chosen.at("horse").at("test"), 2);
  EXPECT_EQ(summary.species_not_listed.at("skunk"), 1);
  EXPECT_THAT(summary.notes, Contains("test: 2 pictures could be chosen, 3 were asked for"));
  EXPECT_THAT(summary.notes, Contains(HasSubstr("train: 1 pictures tell no species")));
  const json document = json::parse(manifests::read_file(scratch_.path() / "out/subset.json"));
  EXPECT_EQ(document["list"]["sha256"], manifests::sha256_file(summary.list));
  EXPECT_EQ(document["inputs"]["ap10k ap10k.json"], manifests::sha256_file(scratch_.path() / "ap10k.json"));
  EXPECT_EQ(document["inputs"]["superanimal/test test.json"], manifests::sha256_file(root() / "test.json"));
}

TEST_F(Curate, a_dataset_takes_what_the_list_chose) {
  write_all();
  json balanced = rule();
  balanced["pictures"]["train"] =
      4;  // cheetah 2, bear 1, horse 1: level 1, and one more to the first with more
  const fs::path list = run(balanced).list;
  const loaders::formats::Dataset dataset = candidates::load_configured(curated("train", list));
  std::multiset<std::string> species;
  for (const auto& record : dataset.records) {
    species.insert(record.species);
    EXPECT_EQ(record.failure, manifests::Reason::none);
  }
  EXPECT_EQ(species, (std::multiset<std::string>{"bear", "cheetah", "cheetah", "horse"}));
  EXPECT_EQ(dataset.notes.back().text, "curation takes 4 pictures: 4 of 8 samples");
  ASSERT_EQ(dataset.files.size(), 2U);
  EXPECT_EQ(dataset.files[1], list);
  EXPECT_EQ(candidates::load_configured(curated("test", list)).records.size(), 2U);
}

TEST_F(Curate, a_list_of_other_files_is_refused) {
  write_all();
  const fs::path list = run(rule()).list;
  const auto refusal = [&](const std::string& split, const std::string& text) -> std::string {
    std::ofstream(scratch_.path() / "list.csv") << text;
    try {
      candidates::load_configured(curated(split, scratch_.path() / "list.csv"));
    } catch (const run::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  const std::string good = manifests::read_file(list);
  EXPECT_EQ(refusal("train", good), "accepted");
  EXPECT_THAT(refusal("train", good + "train,other.jpg,chosen,horse,,\n"),
              HasSubstr("chooses 1 pictures that the dataset does not have, the first is other.jpg"));
  EXPECT_THAT(refusal("train", good + "train,horse_1_1.jpg,chosen,horse,,\n"), HasSubstr("listed before"));
  EXPECT_THAT(refusal("train", "a,b\n"), HasSubstr("line 1: got another header"));
  EXPECT_THAT(refusal("train", good + "train,x\n"), HasSubstr("line 13: got 2 cells"));
  EXPECT_THAT(refusal("train", good.substr(0, good.find('\n') + 1)),
              HasSubstr("chooses no picture of the split"));
  EXPECT_THROW(candidates::load_configured(curated("train", scratch_.path() / "nowhere.csv")),
               run::ConfigError);
}

TEST_F(Curate, the_rule_is_read_strictly) {
  const auto refusal = [&](const char* pointer, const char* value) -> std::string {
    json document = rule();
    document[json::json_pointer(pointer)] = json::parse(value);
    try {
      parse_curation_config(document, "t");
    } catch (const run::ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal("/cap", "300"), "accepted");
  EXPECT_THAT(refusal("/cap", "0"), HasSubstr("\"cap\" must be greater than 0"));
  EXPECT_THAT(refusal("/sed", "1"), HasSubstr("did you mean \"seed\"?"));
  EXPECT_THAT(refusal("/pictures", R"({"train": 5})"), HasSubstr("the split \"test\" has no number"));
  EXPECT_THAT(refusal("/pictures/val", "5"), HasSubstr("no dataset has the split \"val\""));
  EXPECT_THAT(refusal("/pictures/train", "0.5"), HasSubstr("greater than 0, got 0.5"));
  EXPECT_THAT(refusal("/species", "{}"), HasSubstr("names that count as it"));
  EXPECT_THAT(refusal("/species/Polar", R"(["bear"])"), HasSubstr("lower case"));
  EXPECT_THAT(refusal("/species/bear", "[]"), HasSubstr("list of texts"));
  EXPECT_THAT(refusal("/sources/0/annotations", "[3]"), HasSubstr("got 3 in it"));
  EXPECT_THAT(refusal("/sources/0/annotation", "[]"), HasSubstr("did you mean \"annotations\"?"));
  EXPECT_THAT(refusal("/datasets/1/split", "\"train\""), HasSubstr("two have the split"));
  EXPECT_THAT(refusal("/datasets/1/curation", "\"x.csv\""), HasSubstr("is what this makes"));
  EXPECT_THAT(refusal("/name", "\"a/b\""), HasSubstr("becomes a file's name"));
  for (const char* key : {"datasets", "species", "pictures"}) {
    json document = rule();
    document.erase(key);
    EXPECT_THROW(parse_curation_config(document, "t"), run::ConfigError) << key;
  }
}

TEST_F(Curate, a_name_of_two_species_is_a_config_error) {
  write_all();
  json document = rule();
  document["species"]["pony"] = {"horse"};
  EXPECT_THROW(run(document), run::ConfigError);
}

// The rule that ships has 23 species, whose names are each listed once.
TEST_F(Curate, the_shipped_rule_has_23_species) {
  const fs::path file = q3d::testing::source_dir() / "configs/quadruped2d.json";
  const CurationConfig config = load_curation_config({file});
  EXPECT_EQ(config.rule.species.size(), 23U);
  EXPECT_EQ(config.rule.pictures.at("train") + config.rule.pictures.at("test"), 24'000);
  EXPECT_TRUE(loaders::curation::curate({}, config.rule).empty());
  EXPECT_TRUE(config.datasets[0].root.is_absolute());
}

}  // namespace
}  // namespace q3d::pipeline::curation
