// The datasets' known traps, as far as they concern loading; one test a trap, numbered as in
// docs/datasets.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loaders/pictures/box.h"
#include "loaders/pictures/image.h"
#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Family;
using manifests::Reason;
using manifests::SampleRecord;
using ::testing::HasSubstr;

TEST(Traps, trap_01_v_is_kept_raw_and_the_weight_is_zero_or_one) {
  const Folder folder;
  json record = prima_record();
  const std::vector<double> values{-1, 0, 1, 2};
  for (std::size_t i = 0; i < values.size(); ++i) record["keypoint_2d"][i][2] = values[i];
  const SampleRecord loaded = folder.load_prima({record}).records[0];
  const std::vector<float> weights{0, 0, 1, 1};
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(loaded.keypoints[i].v, values[i]);
    EXPECT_EQ(loaded.keypoints[i].weight, weights[i]);
  }
}

TEST(Traps, trap_02_all_codes_of_a_missing_keypoint_are_unlabelled) {
  const Folder folder;
  json record = prima_record();
  record["keypoint_2d"][0] = {0, 0, 0};     // AP-10K
  record["keypoint_2d"][1] = {-1, -1, -1};  // SuperAnimal
  record["keypoint_2d"][2] = {-1, -1, 0};   // Animal Kingdom
  record["keypoint_2d"][3] = {nullptr, nullptr, 0};
  record["keypoint_2d"][4] = {nullptr, nullptr, nullptr};
  const SampleRecord loaded = folder.load_prima({record}).records[0];
  ASSERT_EQ(loaded.failure, Reason::none) << loaded.failure_detail;
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(loaded.keypoints[i].weight, 0.0F) << i;
  EXPECT_EQ(loaded.keypoints[5].weight, 1.0F);
  for (auto& row : record["keypoint_2d"]) row = {-1, -1, -1};
  EXPECT_EQ(folder.load_prima({record}).records[0].failure, Reason::no_visible_keypoints);
}

TEST(Traps, trap_03_num_keypoints_is_not_believed) {
  const Folder folder;
  json document = superanimal_document();
  document["annotations"][0]["keypoints"] = flat(json(39, {-1, -1, -1}));
  EXPECT_EQ(folder.load("superanimal", document).records[0].failure, Reason::no_visible_keypoints);
  document["annotations"][0]["keypoints"][0] = 20.5;
  document["annotations"][0]["keypoints"][1] = 21.25;
  document["annotations"][0]["keypoints"][2] = 2;
  EXPECT_EQ(folder.load("superanimal", document).records[0].failure, Reason::none);
}

TEST(Traps, trap_04_averaged_positions_keep_their_fractions) {
  const Folder folder;
  json record = prima_record();
  record["keypoint_2d"][8] = {25.333333333333332, 17.666666666666668, 1};
  const SampleRecord loaded = folder.load_prima({record}).records[0];
  EXPECT_EQ(loaded.keypoints[8].x_px, 25.333333333333332);
  EXPECT_EQ(loaded.keypoints[8].y_px, 17.666666666666668);
}

TEST(Traps, trap_05_a_neck_at_the_shoulders_gets_no_weight) {
  const Folder folder;
  for (const auto& [source, weight] : std::vector<std::pair<std::string, float>>{
           {"AP-10K", 0}, {"ap10k", 0}, {"APT-36K", 0}, {"cheetah", 0}, {"AwA-Pose", 1}, {"horse-10", 1}}) {
    json document = superanimal_document();
    document["images"][0]["source_dataset"] = source;
    const SampleRecord loaded = folder.load("superanimal", document).records[0];
    EXPECT_EQ(loaded.keypoints[18].weight, weight) << source;
    EXPECT_EQ(loaded.keypoints[18].v, 1.0F) << source;
    EXPECT_EQ(loaded.keypoints[7].weight, 1.0F) << source;
  }
}

TEST(Traps, trap_06_the_tail_tip_is_19_and_its_middle_25) {
  EXPECT_EQ(keypoints::topology("animal3d26").keypoints[19], "tail_tip");
  EXPECT_EQ(keypoints::topology("animal3d26").keypoints[25], "tail_mid");
}

TEST(Traps, trap_07_masks_that_are_missing_or_are_the_picture) {
  const Folder folder;
  json missing = prima_record();
  missing["mask_path"] = "masks/none.png";
  json picture = prima_record();
  picture["mask_path"] = picture["img_path"];
  const Dataset dataset = folder.load_prima({missing, picture, prima_record()});
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(dataset.records[i].failure, Reason::none);
    EXPECT_EQ(dataset.records[i].mask_path, "");
  }
  EXPECT_NE(dataset.records[2].mask_path, "");
  EXPECT_THAT(
      joined(dataset.notes),
      HasSubstr("names a file that does not exist, so the sample has no mask: 1 record, first set/train/"));
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("names the picture itself, so the sample has no mask: 1 record"));
  // 0/1 masks and photographs under another name: DecodeMask.kinds_are_told_apart.
}

// One animal at (x1, y1)..(x2, y2) with keypoints on its diagonal.
json document_with_boxes(const std::vector<std::array<double, 4>>& corners, bool written_as_corners) {
  json document = superanimal_document(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto [x1, y1, x2, y2] = corners[i];
    json& annotation = document["annotations"][i];
    annotation["bbox"] = written_as_corners ? json{x1, y1, x2, y2} : json{x1, y1, x2 - x1, y2 - y1};
    json rows = json::array();
    for (int k = 0; k < 39; ++k) rows.push_back({x1 + (x2 - x1) * k / 38.0, y1 + (y2 - y1) * k / 38.0, 2});
    annotation["keypoints"] = flat(rows);
  }
  return document;
}

TEST(Traps, trap_08_boxes_written_as_corners_are_found_out_and_noted) {
  const Folder folder;  // pictures of 64 x 48 px
  // The second box fits either reading; the first and third pass the border if read as x, y, width, height.
  const std::vector<std::array<double, 4>> corners{{30, 20, 60, 45}, {2, 3, 25, 22}, {20, 25, 50, 40}};
  for (const bool written_as_corners : {true, false}) {
    const Dataset dataset = folder.load("superanimal", document_with_boxes(corners, written_as_corners));
    for (std::size_t i = 0; i < corners.size(); ++i) {
      ASSERT_EQ(dataset.records[i].failure, Reason::none) << dataset.records[i].failure_detail;
      EXPECT_EQ(dataset.records[i].box.x_px, corners[i][0]);
      EXPECT_EQ(dataset.records[i].box.w_px, corners[i][2] - corners[i][0]) << i;
      EXPECT_EQ(dataset.records[i].box.h_px, corners[i][3] - corners[i][1]) << i;
    }
    EXPECT_EQ(joined(dataset.notes).find("read as x1, y1, x2, y2") != std::string::npos, written_as_corners);
  }
}

TEST(Traps, trap_08_boxes_that_pass_the_border_are_not_taken_for_corners) {
  const Folder folder;
  json document = document_with_boxes({{30, 20, 60, 45}}, false);
  document["annotations"][0]["bbox"] = {20, 10, 60, 55};  // 20 px of padding, clipped at 0 only
  const Dataset dataset = folder.load("superanimal", document);
  EXPECT_EQ(dataset.records[0].failure, Reason::none);
  EXPECT_EQ(dataset.records[0].box.w_px, 60.0);
}

TEST(Traps, trap_08_a_measured_pseudo_label_box) {
  // A frame of DeepLabCut's video adaptation: box 263.7, 107.4, 1370.6, 1075.9 around keypoints
  // x 293..1353, y 143..1052 of a 1920 x 1080 picture.
  SampleRecord record;
  record.width_px = 1920;
  record.height_px = 1080;
  record.box = {263.7, 107.4, 1370.6, 1075.9};
  record.keypoints[0] = {293, 143, 1, 1};
  record.keypoints[1] = {1353, 1052, 1, 1};
  const pictures::BoxVote vote = pictures::vote_on_boxes({&record, 1});
  EXPECT_TRUE(vote.is_corners());
}

TEST(Traps, trap_08_zero_sized_boxes_fail) {
  const Folder folder;
  json record = prima_record();
  record["bbox"] = {20, 20, 0, 15};
  EXPECT_EQ(folder.load_prima({record}).records[0].failure, Reason::box_zero_size);
}

TEST(Traps, trap_09_images_without_an_annotation_are_noted_and_points_outside_are_kept) {
  const Folder folder;
  json document = superanimal_document(2);
  document["annotations"].erase(1);
  document["annotations"][0]["keypoints"][0] = -5.0;
  document["annotations"][0]["bbox"] = {-7, 5, 55, 30};
  const Dataset dataset = folder.load("superanimal", document);
  ASSERT_EQ(dataset.records.size(), 1U);
  EXPECT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].keypoints[24].x_px, -5.0);
  EXPECT_THAT(joined(dataset.notes), HasSubstr("images without an annotation: 1"));
}

TEST(Traps, trap_10_exif_does_not_turn_the_picture) {
  const pictures::DecodedImage turned =
      pictures::decode_image(q3d::testing::data_dir() / "images/exif_turned.jpg");
  const pictures::DecodedImage plain = pictures::decode_image(q3d::testing::data_dir() / "images/rgb.jpg");
  ASSERT_EQ(turned.failure, Reason::none) << turned.detail;
  EXPECT_EQ(turned.rgb.size(), cv::Size(24, 16));
  EXPECT_EQ(cv::norm(turned.rgb, plain.rgb, cv::NORM_INF), 0.0);
}

TEST(Traps, trap_11_content_decides_not_the_name) {
  for (const char* name : {"png_inside.jpg", "cmyk.jpg", "palette.png", "grey.jpg"}) {
    const pictures::DecodedImage decoded = pictures::decode_image(q3d::testing::data_dir() / "images" / name);
    EXPECT_EQ(decoded.failure, Reason::none) << name << ": " << decoded.detail;
    EXPECT_EQ(decoded.rgb.channels(), 3);
  }
}

TEST(Traps, trap_12_case_plus_and_endings) {
  const Folder folder;
  write_picture(folder.root() / "images/German Shepherd_10001_5.JPG");
  write_picture(folder.root() / "images/siamese+cat_10002_6.jpeg");
  write_picture(folder.root() / "images/twin.JPG");
  write_picture(folder.root() / "images/twin.jpeg");
  json document = superanimal_document(3);
  document["images"][0]["file_name"] = "german+shepherd_10001_5.jpeg";
  document["images"][1]["file_name"] = "images/Siamese cat_10002_6.JPEG";
  document["images"][2]["file_name"] = "TWIN.jpg";
  const Dataset dataset = folder.load("superanimal", document);
  EXPECT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].species, "german shepherd");
  EXPECT_EQ(dataset.records[0].family, Family::canidae);
  EXPECT_EQ(dataset.records[1].failure, Reason::none) << dataset.records[1].failure_detail;
  EXPECT_EQ(dataset.records[1].species, "siamese cat");
  EXPECT_EQ(dataset.records[2].failure, Reason::image_missing);
  EXPECT_THAT(dataset.records[2].failure_detail, HasSubstr("could be"));
  EXPECT_THAT(joined(dataset.notes), HasSubstr(".jpeg: 2"));
}

TEST(Traps, trap_13_absolute_names_of_the_authors_disk) {
  const Folder folder;
  json document = superanimal_document(3);
  document["images"][0]["file_name"] = "/media/author/superquadruped/images/horse_11361_0.png";
  document["images"][1]["file_name"] = (folder.root() / "images/horse_11361_1.png").string();
  document["images"][2]["file_name"] = "/media/author/images/other_1_2.png";
  const Dataset dataset = folder.load("superanimal", document);
  EXPECT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].image_path,
            (std::filesystem::canonical(folder.root()) / "images/horse_11361_0.png").string());
  EXPECT_EQ(dataset.records[0].id, "set/train/horse_11361_0.png#7");
  EXPECT_EQ(dataset.records[1].failure, Reason::none) << dataset.records[1].failure_detail;
  EXPECT_EQ(dataset.records[2].failure, Reason::path_escapes_root);
  EXPECT_THAT(joined(dataset.notes), HasSubstr("found by the last parts of the name: 1"));
}

TEST(Traps, trap_13_equal_base_names_are_told_apart_by_their_folders) {
  const Folder folder;
  write_picture(folder.root() / "images/clip_a/frame_1.png");
  write_picture(folder.root() / "images/clip_b/frame_1.png");
  json document = superanimal_document(3);
  document["images"][0]["file_name"] = "/disk/x/clip_a/frame_1.png";
  document["images"][1]["file_name"] = "/disk/y/clip_b/frame_1.png";
  document["images"][2]["file_name"] = "/disk/y/clip_c/frame_1.png";  // neither of them
  const Dataset dataset = folder.load("superanimal", document);
  EXPECT_THAT(dataset.records[0].image_path, HasSubstr("clip_a"));
  EXPECT_THAT(dataset.records[1].image_path, HasSubstr("clip_b"));
  EXPECT_EQ(dataset.records[2].failure, Reason::path_escapes_root);
}

TEST(Traps, trap_13_two_names_for_one_file_are_noted) {
  const Folder folder;
  json document = superanimal_document(2);
  document["images"][0]["file_name"] = "/disk/x/horse_11361_0.png";
  document["images"][1]["file_name"] = "/disk/y/horse_11361_0.png";
  EXPECT_THAT(joined(folder.load("superanimal", document).notes),
              HasSubstr("as an earlier name (one of them must be wrong): 1"));
}

TEST(Traps, trap_13_links) {
  const Folder folder;
  const auto images = folder.root() / "images";
  write_picture(folder.root().parent_path() / "secret/outside.png");
  std::filesystem::create_symlink("nowhere.png", images / "broken.png");
  std::filesystem::create_symlink("horse_11361_0.png", images / "inside.png");
  std::filesystem::create_symlink("../../secret/outside.png", images / "leak.png");
  std::filesystem::create_directory_symlink("../../secret", images / "folder");
  json document = superanimal_document(3);
  document["annotations"].push_back(document["annotations"][0]);
  document["images"].push_back(document["images"][0]);
  document["images"][3]["id"] = document["annotations"][3]["image_id"] = 555;
  document["images"][0]["file_name"] = "broken.png";
  document["images"][1]["file_name"] = "inside.png";
  document["images"][2]["file_name"] = "leak.png";
  document["images"][3]["file_name"] = "folder/outside.png";
  const Dataset dataset = folder.load("superanimal", document);
  EXPECT_EQ(dataset.records[0].failure, Reason::image_missing);
  EXPECT_THAT(dataset.records[0].failure_detail, HasSubstr("link to nothing"));
  EXPECT_EQ(dataset.records[1].failure, Reason::none) << dataset.records[1].failure_detail;
  EXPECT_EQ(dataset.records[2].failure, Reason::path_escapes_root);
  EXPECT_EQ(dataset.records[3].failure, Reason::path_escapes_root);
}

TEST(Traps, trap_13_a_folder_of_pictures_that_the_user_names_may_lie_outside) {
  const Folder folder;
  write_picture(folder.root().parent_path() / "elsewhere/horse_11361_0.png", 32, 24);
  DatasetOptions options = folder.options("superanimal");
  write_text(folder.root() / "train.json", superanimal_document().dump());
  options.images = folder.root().parent_path() / "elsewhere";
  const Dataset dataset = load_dataset(options);
  ASSERT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_THAT(dataset.records[0].image_path, HasSubstr("elsewhere"));
}

TEST(Traps, trap_14_one_record_an_animal) {
  const Folder folder;
  json document = superanimal_document(2);
  document["annotations"][1]["image_id"] = 100;
  const Dataset dataset = folder.load("superanimal", document);
  ASSERT_EQ(dataset.records.size(), 2U);
  EXPECT_EQ(dataset.records[0].image_path, dataset.records[1].image_path);
  EXPECT_NE(dataset.records[0].id, dataset.records[1].id);
}

TEST(Traps, trap_15_3d_keypoints_are_the_files_own_numbers) {
  const Folder folder;
  json record = prima_record();
  record["keypoint_3d"][7] = {-0.567, 0.209, 1.5};
  const auto truth = folder.load_prima({record}).records[0].truth;
  ASSERT_TRUE(truth.has_value());
  EXPECT_EQ(truth->keypoints_3d[21], -0.567F);
  EXPECT_EQ(truth->keypoints_3d[23], 1.5F);
}

TEST(Traps, trap_16_betas_in_one_list_or_two_or_the_first_alone) {
  const Folder folder;
  json whole = prima_record();
  whole.erase("shape_extra");
  whole["shape"] = std::vector<double>(41, 0.5);
  json first = prima_record();
  first.erase("shape_extra");
  json wrong = prima_record();
  wrong["shape_extra"] = std::vector<double>(20, 0.3);  // "20 + 20"
  const Dataset dataset = folder.load_prima({whole, first, wrong});
  EXPECT_EQ(dataset.records[0].truth->betas[40], 0.5F);
  EXPECT_EQ(dataset.records[1].failure, Reason::none) << dataset.records[1].failure_detail;
  EXPECT_EQ(dataset.records[1].truth->betas[19], 0.2F);
  EXPECT_EQ(dataset.records[1].truth->betas[20], 0.0F);
  EXPECT_EQ(dataset.records[2].failure, Reason::record_malformed);
  EXPECT_THAT(joined(dataset.notes), HasSubstr("shape_extra is missing"));
}

TEST(Traps, betas_of_another_body_model_are_no_label_and_the_pose_is) {
  const Folder folder;
  json other = prima_record();
  other.erase("shape_extra");
  other["shape"] = std::vector<double>(145, 0.5);
  const Dataset dataset = folder.load_prima({other, prima_record()});
  ASSERT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_FALSE(dataset.records[0].truth->has_betas);
  EXPECT_TRUE(dataset.records[0].truth->has_pose);
  EXPECT_EQ(dataset.records[0].truth->pose_axis_angle[5], 0.1F);
  EXPECT_EQ(dataset.records[0].keypoints[0].weight, 1.0F);
  EXPECT_TRUE(dataset.records[1].truth->has_betas);
  EXPECT_THAT(joined(dataset.notes), HasSubstr("shape has 145 numbers"));
}

TEST(Traps, trap_17_zeros_are_no_truth_and_single_zeros_do_not_undo_it) {
  const Folder folder;
  json zeros = prima_record();
  zeros["pose"] = std::vector<double>(105, 0.0);
  zeros["shape"] = std::vector<double>(20, 0.0);
  zeros["shape_extra"] = std::vector<double>(21, 0.0);
  zeros["keypoint_3d"] = json(26, {0.0, 0.0, 0.0});
  json pose = zeros;
  pose["pose"][17] = 0.25;
  const Dataset dataset = folder.load_prima({zeros, pose});
  EXPECT_FALSE(dataset.records[0].truth.has_value());
  ASSERT_TRUE(dataset.records[1].truth.has_value());
  EXPECT_TRUE(dataset.records[1].truth->has_pose);
  EXPECT_FALSE(dataset.records[1].truth->has_betas);
  EXPECT_FALSE(dataset.records[1].truth->has_keypoints_3d);
}

TEST(Traps, trap_20_birds_and_primates_among_the_mammals) {
  const Folder folder;
  struct Animal {
    const char* animal;
    const char* subclass;
    const char* animal_class;
    Reason reason;
    Family family;
  };
  const std::vector<Animal> animals{
      {"Wedge Tailed Eagle", "Bird", "Bird", Reason::not_a_quadruped, Family::none},
      {"Maroon Macaque", "Primate / Monkey / Macaque / Baboon", "Mammal", Reason::not_a_quadruped,
       Family::none},
      {"Kangaroo", "Kangaroo / Wallaby", "Mammal", Reason::not_a_quadruped, Family::none},
      {"Short Beaked Echina", "Echina", "Mammal", Reason::not_a_quadruped, Family::none},
      {"Platypus", "Platypus", "Mammal", Reason::not_a_quadruped, Family::none},
      {"Harpy Eagle", "Raptor", "Mammal", Reason::not_a_quadruped, Family::none},  // filed wrongly
      {"Frog", "Frog / Toad", "Amphibian", Reason::not_a_quadruped, Family::none},
      {"Californian Sea Lion", "Seal", "Mammal", Reason::not_a_quadruped, Family::none},
      {"Lion", "Cat / Lion / Tiger", "Mammal", Reason::none, Family::felidae},
      {"Jaguarundi Cat", "Cat / Lion / Civet cat", "Mammal", Reason::none, Family::felidae},
      {"Chamois Goat Antelope", "Deer / Antelope / Caribou / Moose", "Mammal", Reason::none, Family::bovidae},
      {"Reindeer", "Deer / Antelope / Caribou / Moose", "Mammal", Reason::none, Family::none},
      {"Smooth-Coated Otter", "Otter", "Mammal", Reason::none, Family::none},
      {"Prairie dog", "Squirrel", "Mammal", Reason::none, Family::none},
      {"Przewalski", "Horse / Zebra", "Mammal", Reason::none, Family::equidae},  // by its subclass
  };
  json list = json::array();
  for (const Animal& each : animals) {
    json record = kingdom_record();
    record["animal"] = each.animal;
    record["animal_subclass"] = each.subclass;
    record["animal_class"] = record["animal_parent_class"] = each.animal_class;
    list.push_back(record);
  }
  const Dataset dataset = folder.load("animal_kingdom", list);
  ASSERT_EQ(dataset.records.size(), animals.size());
  for (std::size_t i = 0; i < animals.size(); ++i) {
    EXPECT_EQ(dataset.records[i].failure, animals[i].reason)
        << animals[i].animal << ": " << dataset.records[i].failure_detail;
    EXPECT_EQ(dataset.records[i].family, animals[i].family) << animals[i].animal;
  }
}

TEST(Traps, trap_22_a_git_lfs_pointer_is_no_picture) {
  const Folder folder;
  const auto path = folder.root() / "images/pointer.png";
  write_text(path, "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 81234\n");
  EXPECT_EQ(folder.load_prima({prima_record("images/pointer.png")}).records[0].failure, Reason::none);
  const pictures::DecodedImage decoded = pictures::decode_image(path);
  EXPECT_EQ(decoded.failure, Reason::image_is_lfs_pointer);
  EXPECT_THAT(decoded.detail, HasSubstr("pointer.png"));
}

}  // namespace
}  // namespace q3d::loaders::formats
