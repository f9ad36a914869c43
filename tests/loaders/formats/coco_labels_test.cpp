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

std::string refusal(const Lab& lab, const json& document) {
  try {
    lab.load(document);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(CocoLabels, refuses_what_it_would_misread) {
  Lab lab;
  json document = lab_document();
  document["categories"][0]["keypoints"] = {"L-eye", "R-eye", "Snout", "tail"};
  EXPECT_THAT(refusal(lab, document),
              HasSubstr("L-eye, R-eye, Snout, tail; only 1 are in the topology mine"));
  EXPECT_THAT(refusal(lab, document), HasSubstr("eye_l, eye_r, snout, horn"));
  document["categories"][0]["keypoints"][2] = "nose";
  EXPECT_THAT(refusal(lab, document), HasSubstr("none is in the topology mine"));
  document["categories"][0]["keypoints"] = {"snout", "eye_r", "eye_l", "Eye_l"};
  EXPECT_THAT(refusal(lab, document), HasSubstr("\"Eye_l\", which occurs twice"));
  lab.options.topology = lab.folder.root() / "nowhere.json";
  EXPECT_THAT(refusal(lab, lab_document()), HasSubstr("nowhere.json"));
}

TEST(CocoLabels, missing_keypoints_have_no_weight_and_unknown_ones_are_left_out) {
  const Lab lab;
  json document = lab_document();
  document["annotations"].erase(1);
  document["annotations"][0].erase("bbox");
  document["categories"][0]["keypoints"] = {"tail", "snout", "eye_r", "hoof"};
  document["annotations"][0]["keypoints"] = {60, 47, 2, 20, 21, 2, 12, 11, 2, 1, 1, 2};
  const Dataset dataset = lab.load(document);
  const SampleRecord& record = dataset.records.at(0);
  ASSERT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.keypoints[kNose].x_px, 20.0);
  EXPECT_EQ(record.keypoints[1].y_px, 11.0);
  EXPECT_EQ(record.keypoints[0].v, 0.0F);
  EXPECT_EQ(record.keypoints[0].weight, 0.0F);
  EXPECT_DOUBLE_EQ(record.box.w_px, 8 + 2 * 0.1 * 10) << "around the known points alone";
  EXPECT_THAT(
      joined(dataset.notes),
      HasSubstr("train.json: keypoints of the topology mine that the file lacks, which get weight 0: 2 of 4 "
                "(eye_l, horn); keypoints of the file that the topology mine lacks, which are left out: 2 "
                "of 4 (tail, hoof)"));
}

// A second category with another order, a third without keypoints, and rectangles of the third.
TEST(CocoLabels, each_category_has_its_own_list) {
  Lab lab;
  json document = lab_document();
  document["categories"].push_back(
      {{"id", "s"}, {"name", "sheep"}, {"keypoints", {"eye_l", "eye_r", "snout"}}});
  document["categories"].push_back({{"id", 11}, {"name", "rectangle"}});
  document["annotations"][1]["category_id"] = "s";
  document["annotations"][1]["keypoints"] = {22, 23, 2, 12, 11, 2, 13, 14, 2};
  document["annotations"].push_back(
      {{"id", 3}, {"image_id", 4}, {"category_id", 11}, {"bbox", {8, 8, 36, 26}}});
  const Dataset dataset = lab.load(document);
  ASSERT_EQ(dataset.records.size(), 2U);
  EXPECT_EQ(dataset.records[1].failure, Reason::none) << dataset.records[1].failure_detail;
  EXPECT_EQ(dataset.records[1].keypoints[0].x_px, 22.0);
  EXPECT_EQ(dataset.records[1].keypoints[kNose].x_px, 13.0);
  EXPECT_EQ(dataset.records[1].species, "sheep");
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("category \"sheep\": keypoints of the topology mine that the file lacks"));
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("annotations without keypoints, of categories that list none, are left out: 1"));

  lab.options.categories = {"sheep"};
  EXPECT_EQ(lab.load(document).records.size(), 1U);
  EXPECT_THAT(joined(lab.load(document).notes), HasSubstr("that are not chosen are left out: 2"));
  lab.options.categories = {"cow"};
  EXPECT_THAT(refusal(lab, document), HasSubstr("got \"cow\", expected names of"));
  EXPECT_THAT(refusal(lab, document), HasSubstr("goat, sheep, rectangle"));
}

TEST(CocoLabels, a_tool_s_word_is_no_species) {
  Lab lab;
  json document = lab_document();
  document["images"][0]["file_name"] = "plain.png";
  write_picture(lab.folder.root() / "images/plain.png");
  document["categories"][0]["name"] = "default";
  EXPECT_EQ(lab.load(document).records[0].species, "");
  document["categories"][0]["name"] = "wombat";
  EXPECT_EQ(lab.load(document).records[0].species, "wombat");
}

// Tools write these values where nobody drew a box or knew a size.
TEST(CocoLabels, placeholders_are_absent_values) {
  const Lab lab;
  for (const json& box :
       {json(), json::array(), json{0, 0, 0, 0}, json{12, 13, 0, 0}, json{nullptr, nullptr, 0, 0}}) {
    json document = lab_document();
    document["annotations"][0]["bbox"] = box;
    const SampleRecord record = lab.load(document).records[0];
    EXPECT_EQ(record.failure, Reason::none) << box << record.failure_detail;
    EXPECT_DOUBLE_EQ(record.box.w_px, 21 + 4.4) << box;
  }
  for (const json& size : {json(), json(0), json(-1), json(""), json("0"), json(0.0)}) {
    json document = lab_document();
    document["images"][0]["width"] = size;
    const SampleRecord record = lab.load(document).records[0];
    EXPECT_EQ(record.failure, Reason::none) << size << record.failure_detail;
    EXPECT_EQ(record.width_px, 0) << size;
    EXPECT_EQ(record.height_px, 48);
  }
  json document = lab_document();
  document["images"][0]["width"] = "64";
  EXPECT_EQ(lab.load(document).records[0].width_px, 64);
  document["annotations"][0]["bbox"] = {8, 8, 0, 26};
  EXPECT_EQ(lab.load(document).records[0].failure, Reason::box_zero_size) << "somebody drew this";
}

TEST(CocoLabels, labelled_points_where_nobody_put_them_get_no_weight) {
  const Lab lab;
  json document = lab_document();
  document["annotations"][0]["keypoints"] = {20, 21, 2, -1, -1, 2, 0, 0, 1, 0, 9, 2};
  const Dataset dataset = lab.load(document);
  EXPECT_EQ(dataset.records[0].keypoints[1].weight, 0.0F);
  EXPECT_EQ(dataset.records[0].keypoints[1].v, 2.0F) << "as the file has it";
  EXPECT_EQ(dataset.records[0].keypoints[0].weight, 0.0F);
  EXPECT_EQ(dataset.records[0].keypoints[kNose].weight, 1.0F);
  EXPECT_THAT(joined(dataset.notes), HasSubstr("labelled keypoints at (0, 0) or (-1, -1)"));
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("get weight 0: 1 record, first set/train/horse_11361_0.png#1"));
}

class Ids : public ::testing::TestWithParam<std::pair<json, json>> {
};  // of the image, and as annotations have it

TEST_P(Ids, are_keys_of_any_kind) {
  const Lab lab;
  json document = lab_document();
  document["images"].push_back(document["images"][0]);
  document["images"][0]["id"] = GetParam().first;
  document["images"][0]["file_name"] = "horse_11361_1.png";
  for (json& annotation : document["annotations"]) annotation["image_id"] = GetParam().second;
  const Dataset dataset = lab.load(document);
  EXPECT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].image_ref, "horse_11361_1.png");
  const bool is_same = GetParam().first.type() == GetParam().second.type();
  EXPECT_EQ(joined(dataset.notes).find("texts in one place of the file and numbers in another") ==
                std::string::npos,
            is_same || GetParam().first.is_number());
}

INSTANTIATE_TEST_SUITE_P(
    OfImages, Ids,
    ::testing::Values(std::pair(json(-7), json(-7)), std::pair(json(0), json(0)),
                      std::pair(json(9007199254740993), json(9007199254740993)),
                      std::pair(json(18446744073709551615U), json(18446744073709551615U)),
                      std::pair(json("a/b.jpg"), json("a/b.jpg")), std::pair(json("000123"), json("000123")),
                      std::pair(json(1.0), json(1)), std::pair(json(1), json(1.0)),
                      std::pair(json("000123"), json(123)), std::pair(json("17"), json(17))));

TEST(CocoLabels, ids_that_differ_in_the_last_bit_of_64_are_two_images) {
  const Lab lab;
  json document = lab_document();
  document["images"].push_back(document["images"][0]);
  document["images"][0]["id"] = 9007199254740992;
  document["images"][1]["id"] = 9007199254740993;
  document["images"][1]["file_name"] = "horse_11361_1.png";
  document["annotations"][0]["image_id"] = 9007199254740992;
  document["annotations"][1]["image_id"] = 9007199254740993;
  const Dataset dataset = lab.load(document);
  EXPECT_EQ(dataset.records[0].image_ref, "horse_11361_0.png");
  EXPECT_EQ(dataset.records[1].image_ref, "horse_11361_1.png");
}

TEST(CocoLabels, an_id_that_no_image_has_shows_one_that_has) {
  const Lab lab;
  json document = lab_document();
  document["images"][0]["id"] = "x1";
  const SampleRecord record = lab.load(document).records[0];
  EXPECT_EQ(record.failure, Reason::image_not_listed);
  EXPECT_THAT(record.failure_detail,
              HasSubstr("image_id: got 4, expected an id of `images`, such as \"x1\""));
}

TEST(CocoLabels, the_ids_of_annotations_may_be_texts) {
  const Lab lab;
  json document = lab_document();
  document["annotations"][0]["id"] = "first";
  document["annotations"][1]["id"] = "b\n#2";
  const Dataset dataset = lab.load(document);
  EXPECT_EQ(dataset.records[0].id, "set/train/horse_11361_0.png#first");
  EXPECT_EQ(dataset.records[1].id, "set/train/horse_11361_0.png#b_#2");
}

TEST(CocoLabels, files_of_other_tools_are_named) {
  const Lab lab;
  EXPECT_THAT(refusal(lab, {{"shapes", json::array()}, {"imagePath", "a.jpg"}}), HasSubstr("LabelMe's JSON"));
  EXPECT_THAT(refusal(lab, {{"_via_img_metadata", json::object()}}), HasSubstr("VGG Image Annotator"));
  const json result = {{"image_id", 1}, {"category_id", 1}, {"keypoints", json::array()}, {"score", 0.5}};
  EXPECT_THAT(refusal(lab, json::array({result})), HasSubstr("COCO's results"));
  const json task = {{"id", 1}, {"data", json::object()}, {"annotations", json::array()}};
  EXPECT_THAT(refusal(lab, json::array({task})), HasSubstr("Label Studio's own JSON"));
  write_text(lab.folder.root() / "train.json", "0 0.5 0.5 0.2 0.3 0.41 0.44 2\n");
  EXPECT_THROW(load_dataset(lab.options), std::runtime_error);
  try {
    load_dataset(lab.options);
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("as YOLO writes them"));
  }
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
