// COCO labels by a topology file: a lab's own, pseudo-labels with confidences, AP-10K and AnimalPose.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "loaders/pictures/box.h"
#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Family;
using manifests::Reason;
using manifests::SampleRecord;
using ::testing::HasSubstr;

constexpr std::size_t kNose = 24;

// Two goats in one picture, keypoints listed in another order than the topology's.
json lab_document() {
  return {{"images", {{{"id", 4}, {"file_name", "horse_11361_0.png"}, {"width", 64}, {"height", 48}}}},
          {"categories",
           {{{"id", 9},
             {"name", "goat"},
             {"supercategory", "animal"},
             {"keypoints", {"snout", "eye_r", "eye_l", "horn"}}}}},
          {"annotations",
           {{{"id", 1},
             {"image_id", 4},
             {"category_id", 9},
             {"bbox", {8, 8, 36, 26}},
             {"keypoints", {20, 21, 2, 12, 11, 2, 30, 31, 1, 9, 9, 2}}},
            {{"id", 2},
             {"image_id", 4},
             {"category_id", 9},
             {"bbox", {10, 8, 36, 26}},
             {"keypoints", {22, 23, 2, 0, 0, 0, -1, -1, -1, 0, 0, 0}}}}}};
}

struct Lab {
  Lab() {
    write_text(folder.root() / "mine.json",
               json{{"name", "mine"},
                    {"keypoints", {"eye_l", "eye_r", "snout", "horn"}},
                    {"flip_pairs", json::array({json::array({"eye_l", "eye_r"})})},
                    {"animal3d26", {{"left_eye", "eye_l"}, {"right_eye", "eye_r"}, {"nose", "snout"}}}}
                   .dump());
    options = folder.options("coco");
    options.topology = folder.root() / "mine.json";
  }
  Dataset load(const json& document) const {
    write_text(folder.root() / "train.json", document.dump());
    return load_dataset(options);
  }
  Folder folder;
  DatasetOptions options;
};

TEST(CocoLabels, one_record_an_animal_by_the_names_of_the_topology) {
  const Lab lab;
  const Dataset dataset = lab.load(lab_document());
  ASSERT_EQ(dataset.records.size(), 2U);
  const SampleRecord& first = dataset.records[0];
  ASSERT_EQ(first.failure, Reason::none) << first.failure_detail;
  EXPECT_EQ(first.id, "set/train/horse_11361_0.png#1");
  EXPECT_EQ(dataset.records[1].id, "set/train/horse_11361_0.png#2");
  EXPECT_EQ(first.species, "goat");
  EXPECT_EQ(first.family, Family::bovidae);
  EXPECT_EQ(first.keypoints[kNose].x_px, 20.0);
  EXPECT_EQ(first.keypoints[0].x_px, 30.0);  // left_eye
  EXPECT_EQ(first.keypoints[0].v, 1.0F);
  EXPECT_EQ(first.keypoints[1].y_px, 11.0);  // right_eye
  EXPECT_EQ(first.keypoints[2].weight, 0.0F);
  EXPECT_EQ(dataset.records[1].keypoints[0].weight, 0.0F);
  EXPECT_EQ(dataset.records[1].keypoints[0].v, -1.0F);
  EXPECT_EQ(dataset.files, (std::vector<std::filesystem::path>{lab.folder.root() / "train.json",
                                                               lab.folder.root() / "mine.json"}));
}

TEST(CocoLabels, a_confidence_in_the_place_of_v_is_the_weight) {
  Lab lab;
  json document = lab_document();
  document["annotations"][0]["keypoints"] = {20, 21, 0.75, 12, 11, 0.25, 30, 31, 1.0, 9, 9, 0.0};
  const Dataset dataset = lab.load(document);
  const SampleRecord& record = dataset.records[0];
  EXPECT_EQ(record.keypoints[kNose].v, 0.75F);
  EXPECT_EQ(record.keypoints[kNose].weight, 0.75F);
  EXPECT_EQ(record.keypoints[1].v, 0.25F);
  EXPECT_EQ(record.keypoints[1].weight, 0.0F) << "below the default of 0.6";
  EXPECT_EQ(record.keypoints[0].weight, 1.0F);
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("which becomes their weight: 2; of these, below min_confidence 0.6 "
                        "(weight 0): 1"));
  lab.options.min_confidence = 0.2;
  EXPECT_EQ(lab.load(document).records[0].keypoints[1].weight, 0.25F);
}

// Points (9, 9) to (30, 31), all labelled: 21 x 22 px, wider by 0.1 * 22 on each side.
TEST(CocoLabels, a_missing_box_is_made_around_all_keypoints) {
  Lab lab;
  json document = lab_document();
  document["annotations"][0].erase("bbox");
  const Dataset dataset = lab.load(document);
  const manifests::Box& box = dataset.records[0].box;
  ASSERT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_DOUBLE_EQ(box.x_px, 9 - 2.2);
  EXPECT_DOUBLE_EQ(box.y_px, 9 - 2.2);
  EXPECT_DOUBLE_EQ(box.w_px, 21 + 4.4);
  EXPECT_DOUBLE_EQ(box.h_px, 22 + 4.4);
  EXPECT_EQ(dataset.records[1].box.x_px, 10.0) << "the file's own";
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("no box: it was made around the keypoints, with a margin of 0.1"));
  lab.options.box_margin = 0.5;
  EXPECT_DOUBLE_EQ(lab.load(document).records[0].box.w_px, 21 + 22);
  // One point spans no box.
  document["annotations"][1].erase("bbox");
  EXPECT_EQ(lab.load(document).records[1].failure, Reason::box_zero_size);
}

TEST(CocoLabels, the_users_species_stands_over_the_category) {
  Lab lab;
  json document = lab_document();
  lab.options.species = "Sheep";
  EXPECT_EQ(lab.load(document).records[0].species, "sheep");
  lab.options.species = "";
  document["categories"][0]["name"] = "quadruped";
  EXPECT_EQ(lab.load(document).records[0].species, "horse") << "from the picture's name";
  document["categories"][0]["name"] = "goat";
  document["categories"][0]["supercategory"] = "Ursidae";  // a zoological family is the file's own statement
  const Dataset dataset = lab.load(document);
  EXPECT_EQ(dataset.records[0].family, Family::none);
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("species \"goat\" is none in the file and bovidae in the species table"));
  document["categories"][0]["name"] = "spider monkey";
  EXPECT_EQ(lab.load(document).records[0].failure, Reason::not_a_quadruped);
}

TEST(CocoLabels, refuses_what_it_would_misread) {
  Lab lab;
  const auto thrown = [&](const json& document) -> std::string {
    try {
      lab.load(document);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  json document = lab_document();
  document["categories"].push_back({{"id", 10}, {"keypoints", {"eye_l", "eye_r", "snout", "horn"}}});
  EXPECT_THAT(thrown(document), HasSubstr("categories[1]: keypoints: got names that differ"));
  document = lab_document();
  document["categories"][0]["keypoints"][3] = "tail";
  EXPECT_THAT(thrown(document), HasSubstr("\"tail\", which is not in the topology mine"));
  lab.options.topology = lab.folder.root() / "nowhere.json";
  EXPECT_THAT(thrown(lab_document()), HasSubstr("nowhere.json"));
}

// AnimalPose's own keypoints.json: images as a map from id to name, nested keypoints with v = 1, corners.
TEST(CocoLabels, reads_animalpose_as_its_authors_write_it) {
  Lab lab;
  lab.options.topology = q3d::testing::source_dir() / "configs/topologies/animalpose.json";
  json document;
  document["images"] = {{"1", "horse_11361_0.png"}, {"7", "horse_11361_1.png"}, {"x", "horse_11361_2.png"}};
  document["categories"] = {{{"id", 4}, {"name", "horse"}, {"supercategory", "animal"}}};
  document["annotations"] = {{{"image_id", 7},
                              {"category_id", 4},
                              {"bbox", {10, 10, 40, 30}},
                              {"num_keypoints", 20},
                              {"keypoints", keypoint_rows(20)}}};
  const Dataset dataset = lab.load(document);
  const SampleRecord& record = dataset.records.at(0);
  ASSERT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.image_ref, "horse_11361_1.png");
  EXPECT_EQ(record.species, "horse");
  EXPECT_EQ(record.keypoints[kNose].x_px, 10.0 + 30.0 * 2 / 19);
  document["annotations"][0]["image_id"] = 2;
  EXPECT_EQ(lab.load(document).records[0].failure, Reason::image_not_listed);
}

// The samples of AP-10K and AnimalPose that mmpose tests with: 3 + 2 pictures' worth of records.
TEST(CocoLabels, real_samples_load_where_they_are) {
  if (q3d::testing::samples_dir().empty()) GTEST_SKIP() << "set Q3D_SAMPLES_DIR to run this";
  struct Sample {
    std::string folder, file, topology;
    std::size_t records;
  };
  for (const Sample& sample : {Sample{"mmpose_ap10k", "test_ap10k.json", "ap10k", 2},
                               Sample{"mmpose_animalpose", "test_animalpose.json", "animalpose_mmpose", 2}}) {
    DatasetOptions options{.name = sample.folder,
                           .format = "coco",
                           .split = "test",
                           .root = q3d::testing::samples_dir() / sample.folder,
                           .annotations = sample.file,
                           .images = {}};
    options.topology = q3d::testing::source_dir() / "configs/topologies" / (sample.topology + ".json");
    const Dataset dataset = load_dataset(options);
    EXPECT_EQ(dataset.records.size(), sample.records);
    for (const SampleRecord& record : dataset.records) {
      EXPECT_EQ(record.failure, Reason::none) << record.failure_detail;
      EXPECT_NE(record.species, "");
      EXPECT_GE(std::count_if(record.keypoints.begin(), record.keypoints.end(),
                              [](const manifests::Keypoint& point) { return point.weight == 1.0F; }),
                10);
    }
  }
}

}  // namespace
}  // namespace q3d::loaders::formats
