// Topology files: the shipped ones against the published tables, and what is refused.
#include "loaders/keypoints/topology_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loaders/keypoints/builtin_topologies.h"
#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::keypoints {
namespace {

using formats::testing_files::json;
using formats::testing_files::write_text;
using ::testing::HasSubstr;

Topology shipped(const std::string& file) {
  return read_topology_file(q3d::testing::source_dir() / "configs/topologies" / (file + ".json"));
}

std::vector<std::string> shipped_files() {
  return {"acinoset", "animal3d", "animalpose", "animalpose_mmpose", "ap10k",
          "atrw",     "badja",    "horse10",    "stanfordextra",     "superanimal_quadruped"};
}

std::string name_of_source(const Topology& topology, std::size_t keypoint) {
  return topology.keypoints[static_cast<std::size_t>(topology.source[keypoint])];
}

TEST(TopologyFile, all_that_are_shipped_can_be_read_and_mirror_in_pairs) {
  std::vector<std::string> found;
  for (const auto& entry :
       std::filesystem::directory_iterator(q3d::testing::source_dir() / "configs/topologies")) {
    found.push_back(entry.path().stem().string());
  }
  EXPECT_THAT(found, ::testing::UnorderedElementsAreArray(shipped_files()));
  for (const std::string& file : shipped_files()) {
    const Topology each = shipped(file);
    for (std::size_t i = 0; i < each.flip.size(); ++i) {
      EXPECT_EQ(each.flip[static_cast<std::size_t>(each.flip[i])], static_cast<int>(i)) << file;
    }
  }
}

TEST(TopologyFile, shipped_ones_go_by_name_from_any_folder) {
  for (const std::string& name : shipped_files()) {
    EXPECT_TRUE(is_builtin_topology(name));
    const Topology named = read_topology_file(name);
    const Topology file = shipped(name);
    EXPECT_EQ(named.keypoints, file.keypoints) << name;
    EXPECT_EQ(named.source, file.source) << name;
    EXPECT_EQ(named.flip, file.flip) << name;
    EXPECT_EQ(named.weights, file.weights) << name;
  }
  EXPECT_FALSE(is_builtin_topology("./ap10k"));
  EXPECT_FALSE(is_builtin_topology("ap10k.json"));
}

TEST(TopologyFile, a_name_that_is_neither_file_nor_built_in_lists_the_built_in_ones) {
  try {
    read_topology_file("ap11k");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("ap11k: there is no such file"));
    EXPECT_THAT(error.what(), HasSubstr("animalpose_mmpose, ap10k, atrw"));
  }
}

// The table of SMALify, by the authors of BADJA: for each of StanfordExtra's 24 points the index of BADJA's,
// or -1. It has the paws first and the left side first.
TEST(TopologyFile, badja_has_the_sides_of_its_authors_table) {
  const std::vector<int> smalify{14, 13, 12, 24, 23, 22, 10, 9,  8,  20, 19, 18,
                                 25, 31, -1, -1, 33, -1, 36, 35, -1, -1, -1, 15};
  const Topology badja = shipped("badja");
  const Topology stanford = shipped("stanfordextra");
  const std::vector<std::string>& names = topology("animal3d26").keypoints;
  int compared = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (badja.source[i] < 0 || stanford.source[i] < 0) continue;
    const int theirs = smalify.at(static_cast<std::size_t>(stanford.source[i]));
    if (theirs < 0) continue;  // a point that SMALify does not take from BADJA
    EXPECT_EQ(badja.source[i], theirs) << names[i];
    ++compared;
  }
  EXPECT_EQ(compared, 15);  // three joints of four legs, both ends of the tail, the nose
}

TEST(TopologyFile, horse10_near_is_left_and_unsided_points_are_left_out) {
  const Topology horse = shipped("horse10");
  EXPECT_EQ(name_of_source(horse, 3), "Nearfrontfoot");  // left_front_paw
  EXPECT_EQ(name_of_source(horse, 6), "Offhindfoot");    // right_back_paw
  EXPECT_EQ(name_of_source(horse, 16), "Nearhindhock");  // left_back_knee
  EXPECT_EQ(horse.source[0], -1);                        // "Eye" has no side
  EXPECT_EQ(horse.source[10], -1);                       // nor has "Stifle"
}

TEST(TopologyFile, superanimal_is_that_of_its_own_format) {
  const Topology file = shipped("superanimal_quadruped");
  const Topology& own = topology("superanimal_quadruped39");
  EXPECT_EQ(file.name, own.name);
  EXPECT_EQ(file.keypoints, own.keypoints);
  EXPECT_EQ(file.flip, own.flip);
  EXPECT_EQ(file.source, own.source);
  EXPECT_EQ(file.weights, own.weights);
}

// AniMer's author, for AnimalPose's own order; the official AcinoSet converter.
TEST(TopologyFile, published_maps) {
  EXPECT_EQ(shipped("animalpose").source,
            (std::array<int, 26>{0,  1, -1, 13, 14, 15, 16, 19, 5, 6,  7,  8, -1,
                                 -1, 9, 10, 11, 12, -1, -1, 3,  4, -1, -1, 2, -1}));
  EXPECT_EQ(shipped("acinoset").source,
            (std::array<int, 26>{2, 1,  -1, 13, 10, 19, 16, 5,  -1, -1, -1, -1, 11,
                                 8, 12, 9,  18, 15, 3,  7,  -1, -1, -1, -1, 0,  6}));
}

TEST(TopologyFile, both_orders_of_animalpose_give_the_same_26) {
  const Topology original = shipped("animalpose");
  const Topology mmpose = shipped("animalpose_mmpose");
  for (std::size_t i = 0; i < original.source.size(); ++i) {
    EXPECT_EQ(original.source[i] < 0, mmpose.source[i] < 0) << i;
  }
  EXPECT_EQ(name_of_source(original, 3), "left_front_paw");
  EXPECT_EQ(name_of_source(mmpose, 3), "L_F_Paw");
  EXPECT_EQ(name_of_source(original, 17), "right_back_knee");
  EXPECT_EQ(name_of_source(mmpose, 17), "R_B_Knee");
}

// The order of AP-10K's files, and its hips and shoulders as its README explains them.
TEST(TopologyFile, ap10k_shoulders_are_thighs_and_its_neck_has_no_weight) {
  const Topology ap10k = shipped("ap10k");
  EXPECT_EQ(ap10k.keypoints[4], "root_of_tail");
  EXPECT_EQ(ap10k.keypoints[10], "right_front_paw");
  EXPECT_EQ(name_of_source(ap10k, 8), "left_shoulder");  // left_front_thigh
  EXPECT_EQ(name_of_source(ap10k, 17), "right_knee");    // right_back_knee
  EXPECT_EQ(ap10k.source[12], -1);                       // left_shoulder
  std::vector<manifests::Keypoint> points(17, {3.0, 4.0, 2.0F, 1.0F});
  const manifests::Keypoints mapped = to_animal3d(ap10k, points);
  EXPECT_EQ(mapped[18].v, 2.0F);  // neck: the label stays, its weight does not
  EXPECT_EQ(mapped[18].weight, 0.0F);
  EXPECT_EQ(mapped[24].weight, 1.0F);
}

json good_file() {
  return {{"name", "mine"},
          {"keypoints", {"eye_l", "eye_r", "snout"}},
          {"flip_pairs", json::array({json::array({"eye_l", "eye_r"})})},
          {"animal3d26", {{"left_eye", "eye_l"}, {"right_eye", "eye_r"}, {"nose", "snout"}}}};
}

std::string refusal(const json& document) {
  const q3d::testing::ScratchDir scratch;
  write_text(scratch.path() / "mine.json", document.dump());
  try {
    read_topology_file(scratch.path() / "mine.json");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(TopologyFile, reads_a_lab_s_own) {
  const q3d::testing::ScratchDir scratch;
  write_text(scratch.path() / "mine.json", good_file().dump());
  const Topology mine = read_topology_file(scratch.path() / "mine.json");
  EXPECT_EQ(mine.name, "mine");
  EXPECT_EQ(mine.flip, (std::vector<int>{1, 0, 2}));
  EXPECT_EQ(mine.source[0], 0);
  EXPECT_EQ(mine.source[24], 2);
  EXPECT_EQ(std::count(mine.source.begin(), mine.source.end(), -1), 23);
}

// Every rule of the file, broken alone: the message names file, key and what was found.
TEST(TopologyFile, names_what_does_not_fit) {
  ASSERT_EQ(refusal(good_file()), "");
  const auto with = [](const std::string& path, const json& value) {
    json document = good_file();
    document[json::json_pointer(path)] = value;
    return refusal(document);
  };
  const auto without = [](const char* key) {
    json document = good_file();
    document.erase(key);
    return refusal(document);
  };
  for (const char* key : {"name", "keypoints", "flip_pairs", "animal3d26"}) {
    EXPECT_THAT(without(key), HasSubstr(std::string("mine.json: ") + key + ": got nothing"));
  }
  EXPECT_THAT(with("/flips", json::array()), HasSubstr("the key \"flips\""));
  EXPECT_THAT(with("/name", 3), HasSubstr("name: got 3"));
  EXPECT_THAT(with("/keypoints", json::array()), HasSubstr("keypoints: got 0 values"));
  EXPECT_THAT(with("/keypoints/1", "eye_l"), HasSubstr("keypoints[1]: got \"eye_l\" again"));
  EXPECT_THAT(with("/keypoints/1", nullptr), HasSubstr("keypoints[1]: got null"));
  EXPECT_THAT(with("/flip_pairs/0/1", "eye"), HasSubstr("flip_pairs[0]: got \"eye\""));
  EXPECT_THAT(with("/flip_pairs/0/1", "eye_l"), HasSubstr("flip_pairs[0]"));
  EXPECT_THAT(with("/flip_pairs/1", {"eye_l", "snout"}), HasSubstr("flip_pairs[1]"));
  EXPECT_THAT(with("/flip_pairs/0", {"eye_l"}), HasSubstr("flip_pairs[0]: got 1 value"));
  EXPECT_THAT(with("/animal3d26/nostril", "snout"), HasSubstr("\"nostril\", expected one of left_eye, "));
  EXPECT_THAT(with("/animal3d26/nose", "nostril"), HasSubstr("animal3d26.nose: got \"nostril\""));
  EXPECT_THAT(with("/weights", {{"snout", 1.5}}), HasSubstr("weights.snout: got 1.5"));
  EXPECT_THAT(with("/weights", {{"tail", 1}}), HasSubstr("weights.tail: got \"tail\""));
  EXPECT_THAT(with("", json::array()), HasSubstr("top level: got 0 values"));
}

TEST(TopologyFile, a_map_that_mixes_left_and_right_is_refused) {
  json document = good_file();
  document["animal3d26"]["left_eye"] = "snout";
  EXPECT_THAT(refusal(document), HasSubstr("left_eye from \"snout\" and right_eye from \"eye_r\""));
  document = good_file();
  document["flip_pairs"] = json::array();
  EXPECT_THAT(refusal(document), HasSubstr("left_eye from \"eye_l\""));
  document = good_file();
  document["animal3d26"].erase("right_eye");
  document["animal3d26"]["right_ear"] = "eye_r";
  EXPECT_THAT(refusal(document), HasSubstr("left_eye from \"eye_l\" and right_eye from nothing"));
}

TEST(TopologyFile, one_side_alone_may_be_mapped) {
  json document = good_file();
  document["animal3d26"].erase("right_eye");
  EXPECT_EQ(refusal(document), "");
  document["keypoints"] = {"eye_l", "snout"};
  document["flip_pairs"] = json::array();
  EXPECT_EQ(refusal(document), "");
  document["animal3d26"]["right_eye"] = "eye_l";
  EXPECT_EQ(refusal(document), "") << "one keypoint that is its own mirror image";
}

}  // namespace
}  // namespace q3d::loaders::keypoints
