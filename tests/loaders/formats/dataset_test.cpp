// The three formats: good files in full, bad files refused, bad records reported one by one.
#include "loaders/formats/dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Family;
using manifests::Reason;
using manifests::SampleRecord;
using ::testing::HasSubstr;

std::string thrown_by(const Folder& folder, const std::string& format, const std::string& text) {
  try {
    folder.load_text(format, text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(Prima, reads_every_field) {
  const Folder folder;
  const Dataset dataset = folder.load_prima({prima_record()});
  ASSERT_EQ(dataset.records.size(), 1U);
  const SampleRecord& record = dataset.records[0];
  ASSERT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.id, "set/train/images/train/horse/000000000001_horse.png#0");
  EXPECT_EQ(record.dataset, "set");
  EXPECT_EQ(record.split, "train");
  EXPECT_EQ(
      record.image_path,
      (std::filesystem::canonical(folder.root()) / "images/train/horse/000000000001_horse.png").string());
  EXPECT_EQ(record.mask_path, (std::filesystem::canonical(folder.root()) / "masks/one.png").string());
  EXPECT_EQ(record.species, "horse");
  EXPECT_EQ(record.family, Family::equidae);
  EXPECT_EQ(record.width_px, 64);
  EXPECT_EQ(record.height_px, 48);
  EXPECT_EQ(record.box.x_px, 8.0);
  EXPECT_EQ(record.box.w_px, 36.0);
  EXPECT_EQ(record.keypoints[25].x_px, 40.0);
  EXPECT_EQ(record.keypoints[25].y_px, 30.0);
  ASSERT_TRUE(record.truth.has_value());
  EXPECT_TRUE(record.truth->has_pose && record.truth->has_betas && record.truth->has_keypoints_3d);
  EXPECT_EQ(record.truth->pose_axis_angle[104], 0.1F);
  EXPECT_EQ(record.truth->betas[19], 0.2F);
  EXPECT_EQ(record.truth->betas[20], 0.3F);
  EXPECT_EQ(record.truth->betas[40], 0.3F);
  EXPECT_EQ(record.truth->trans[2], 5.0F);
  EXPECT_EQ(record.truth->keypoints_3d[77], 1.0F);
  EXPECT_EQ(joined(dataset.notes), "");
}

TEST(Prima, a_record_of_2d_alone_has_no_truth) {
  const Folder folder;
  json record = prima_record();
  for (const char* field : {"keypoint_3d", "pose", "shape", "shape_extra", "trans", "mask_path", "width",
                            "height", "supercategory"}) {
    record.erase(field);
  }
  const SampleRecord loaded = folder.load_prima({record}).records[0];
  EXPECT_EQ(loaded.failure, Reason::none) << loaded.failure_detail;
  EXPECT_FALSE(loaded.truth.has_value());
  EXPECT_EQ(loaded.mask_path, "");
  EXPECT_EQ(loaded.width_px, 0);
  EXPECT_EQ(loaded.family, Family::equidae) << "from the table, by the picture's name";
}

TEST(Prima, a_family_that_the_file_states_wins_and_the_disagreement_is_noted) {
  const Folder folder;
  write_picture(folder.root() / "images/000000000002_sheep.png");
  json sheep = prima_record("images/000000000002_sheep.png");  // supercategory 2, equidae
  const Dataset dataset = folder.load_prima({sheep});
  EXPECT_EQ(dataset.records[0].species, "sheep");
  EXPECT_EQ(dataset.records[0].family, Family::equidae);
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("species \"sheep\" is equidae in the file and bovidae in the species table"));
  sheep["supercategory"] = -1;  // not stated
  EXPECT_EQ(folder.load_prima({sheep}).records[0].family, Family::bovidae);
}

TEST(SuperAnimal, maps_39_keypoints_by_the_official_table) {
  const Folder folder;
  const Dataset dataset = folder.load("superanimal", superanimal_document(2));
  ASSERT_EQ(dataset.records.size(), 2U);
  const SampleRecord& record = dataset.records[1];
  ASSERT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.id, "set/train/horse_11361_1.png#8");
  EXPECT_EQ(record.source, "AwA-Pose");
  EXPECT_EQ(record.species, "horse");
  EXPECT_EQ(record.family, Family::equidae);
  EXPECT_EQ(record.keypoints[0].x_px, 10.0 + 30.0 * 10 / 38);  // left_eye is the file's 10
  EXPECT_EQ(record.keypoints[24].x_px, 10.0);                  // nose is its 0
  EXPECT_EQ(record.keypoints[2].weight, 0.0F);                 // chin has no source
  EXPECT_FALSE(record.truth.has_value());
}

TEST(SuperAnimal, keypoints_in_another_order_are_taken_by_name) {
  const Folder folder;
  json document = superanimal_document();
  json& names = document["categories"][0]["keypoints"];
  std::swap(names[28], names[29]);  // AwA-Pose has front_right_paw before front_right_knee
  const json rows = keypoint_rows(39);
  const Dataset dataset = folder.load("superanimal", document);
  EXPECT_EQ(dataset.records[0].keypoints[4].x_px, rows[28][0].get<double>()) << "right_front_paw";
  EXPECT_EQ(dataset.records[0].keypoints[15].x_px, rows[29][0].get<double>()) << "right_front_knee";
  EXPECT_THAT(joined(dataset.notes), HasSubstr("matched by name"));
}

TEST(SuperAnimal, keypoints_of_another_dataset_are_refused) {
  const Folder folder;
  json document = superanimal_document();
  document["categories"][0]["keypoints"] = {"nose", "neck", "hip", "hoof"};
  EXPECT_THAT(thrown_by(folder, "superanimal", document.dump()),
              HasSubstr("nose, neck, hip, hoof; only 1 are in the topology superanimal_quadruped39"));
}

TEST(AnimalKingdom, reads_the_list_of_records) {
  const Folder folder;
  const Dataset dataset = folder.load("animal_kingdom", json::array({kingdom_record()}));
  const SampleRecord& record = dataset.records.at(0);
  ASSERT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.id, "set/train/AAAA/AAAA_f000001.png#0");
  EXPECT_EQ(record.species, "wolf");
  EXPECT_EQ(record.family, Family::canidae);
  EXPECT_EQ(record.box.x_px, 10.0);  // centre 25, side 0.15 * 200
  EXPECT_EQ(record.box.w_px, 30.0);
  EXPECT_EQ(record.box.h_px, 30.0);
  EXPECT_EQ(record.keypoints[3].x_px, 10.0 + 30.0 * 11 / 22);  // left_front_paw is Wrist_Left, 11
}

TEST(AnimalKingdom, reads_the_coco_file_by_content) {
  const Folder folder;
  json document;
  std::vector<std::string> names = keypoints::topology("animal_kingdom23").keypoints;
  names[18] += " ";
  document["categories"] = {{{"id", 4}, {"name", "Mammal"}, {"keypoints", names}}};
  document["images"] = {{{"id", 0}, {"file_name", "AAAA/AAAA_f000001.png"}, {"width", 64}, {"height", 48}}};
  json annotation{{"id", 0},
                  {"image_id", 0},
                  {"category_id", 4},
                  {"bbox", {10, 10, 30, 20}},
                  {"keypoints", flat(keypoint_rows(23))}};
  for (const char* field : {"animal", "animal_class", "animal_parent_class", "animal_subclass"})
    annotation[field] = kingdom_record()[field];
  document["annotations"] = {annotation};
  const Dataset dataset = folder.load("animal_kingdom", document);
  ASSERT_EQ(dataset.records.at(0).failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].family, Family::canidae);
  EXPECT_EQ(dataset.records[0].box.h_px, 20.0);
  EXPECT_EQ(dataset.records[0].keypoints[3].x_px, 10.0 + 30.0 * 11 / 22);
}

TEST(Load, refuses_senseless_options) {
  const Folder folder;
  DatasetOptions options = folder.options("voc");
  EXPECT_THROW(load_dataset(options), std::invalid_argument);
  options = folder.options("prima");
  options.name = "a/b";
  EXPECT_THROW(load_dataset(options), std::invalid_argument);
  options = folder.options("prima");
  options.split = "";
  EXPECT_THROW(load_dataset(options), std::invalid_argument);
  options = folder.options("prima");
  options.root = folder.root() / "nowhere";
  EXPECT_THROW(load_dataset(options), std::runtime_error);
  options = folder.options("prima");
  options.annotations = "nothing.json";
  EXPECT_THROW(load_dataset(options), std::runtime_error);
  options = folder.options("superanimal");
  options.images = "pictures";
  EXPECT_THROW(load_dataset(options), std::runtime_error);
}

TEST(Load, a_file_that_cannot_be_read_names_itself_the_place_and_what_was_expected) {
  const Folder folder;
  const std::string good = json{{"data", {prima_record()}}}.dump(1);
  const std::string cut = thrown_by(folder, "prima", good.substr(0, good.size() / 2));
  EXPECT_THAT(cut, HasSubstr("train.json"));
  EXPECT_THAT(cut, HasSubstr("line "));
  EXPECT_THAT(cut, HasSubstr("byte "));
  EXPECT_THAT(cut, HasSubstr("cut short"));
  EXPECT_THAT(thrown_by(folder, "prima", ""), HasSubstr("got an empty file (0 bytes)"));
  EXPECT_LT(thrown_by(folder, "prima", "{\"data\": \"" + std::string(100'000, 'x')).size(), 800U);
  EXPECT_THAT(thrown_by(folder, "prima", "version https://git-lfs.github.com/spec/v1\n"),
              HasSubstr("git lfs pull"));
  EXPECT_THAT(thrown_by(folder, "prima", "<html>quota</html>"), HasSubstr("got an HTML page"));
  EXPECT_THAT(thrown_by(folder, "prima", "{\"data\": nothing}"), HasSubstr("line 1, byte 11"));
  EXPECT_THAT(thrown_by(folder, "prima", "[1, 2]"),
              HasSubstr("got 2 values, expected an object with an array \"data\""));
  EXPECT_THAT(thrown_by(folder, "prima", R"({"data": {"a": 1}})"),
              HasSubstr("data: got an object of 1 keys"));
  EXPECT_THAT(thrown_by(folder, "prima", superanimal_document().dump()), HasSubstr("got COCO's form"));
  EXPECT_THAT(thrown_by(folder, "superanimal", good), HasSubstr("which the format \"prima\" reads"));
  EXPECT_THAT(thrown_by(folder, "superanimal", R"({"images": 3, "annotations": []})"),
              HasSubstr("images: got 3"));
  EXPECT_THAT(thrown_by(folder, "animal_kingdom", "3.5"), HasSubstr("got 3.5"));
}

TEST(Load, ids_are_unique_also_when_annotation_ids_are_not) {
  const Folder folder;
  json document = superanimal_document(3);
  for (auto& annotation : document["annotations"]) annotation["image_id"] = 100;
  document["annotations"][2]["id"] = 7;
  std::set<std::string> ids;
  for (const auto& record : folder.load("superanimal", document).records) ids.insert(record.id);
  EXPECT_EQ(ids, (std::set<std::string>{"set/train/horse_11361_0.png#0", "set/train/horse_11361_0.png#1",
                                        "set/train/horse_11361_0.png#2"}));
}

TEST(Load, ids_and_messages_stay_on_one_line_and_in_utf8) {
  const Folder folder;
  json record = prima_record("images/line\nbreak\u0001.png");
  std::string long_text(59, 'x');
  for (int i = 0; i < 40; ++i) long_text += "\u00e4";  // two bytes each: byte 60 is inside one
  json other = prima_record();
  other["supercategory"] = long_text;
  const Dataset dataset = folder.load_prima({record, other});
  EXPECT_EQ(dataset.records[0].id, "set/train/images/line_break_.png#0");
  EXPECT_NO_THROW(json(dataset.records[1].failure_detail).dump());
}

// A column of a table is as wide as its longest text, so an endless name must not reach one.
TEST(Load, endless_texts_are_shortened_and_stay_apart) {
  const Folder folder;
  const std::string endless(std::size_t{5} << 20U, 'n');
  std::vector<json> records{prima_record("images/" + endless + "1.png"), prima_record(endless + "2.png")};
  std::set<std::string> ids;
  for (const SampleRecord& record : folder.load_prima(records).records) {
    EXPECT_EQ(record.failure, Reason::record_malformed) << record.failure_detail;
    ids.insert(record.id.substr(0, record.id.rfind('#')));
    for (const std::string& text : {record.id, record.image_ref, record.failure_detail, record.species}) {
      EXPECT_LT(text.size(), 600U);
    }
  }
  EXPECT_EQ(ids.size(), 2U);
  json kingdom = kingdom_record();
  kingdom["animal"] = endless;
  const Dataset dataset = folder.load("animal_kingdom", json::array({kingdom}));
  EXPECT_LT(dataset.records[0].species.size(), 600U);
  for (const Note& note : dataset.notes) EXPECT_LT(note.text.size(), 2000U);
}

// The reason that each broken value of a field must lead to. "@" in the JSON stands for a literal that JSON
// does not know.
struct Break {
  const char* field;
  const char* value;  // JSON text
  Reason reason;
};

void PrintTo(const Break& broken, std::ostream* stream) {
  *stream << broken.field << " = " << broken.value;
}

std::string with_field(json record, const Break& broken) {
  record[broken.field] = "@";
  std::string text = record.dump();
  const std::string mark = "\"@\"";
  text.replace(text.find(mark), mark.size(), broken.value);
  return text;
}

void expect_failure(const Dataset& dataset, std::size_t index, const Break& broken) {
  for (std::size_t i = 0; i < dataset.records.size(); ++i) {
    const SampleRecord& record = dataset.records[i];
    if (i != index) {
      EXPECT_EQ(record.failure, Reason::none) << record.failure_detail;
      continue;
    }
    EXPECT_EQ(manifests::to_string(record.failure), manifests::to_string(broken.reason))
        << record.failure_detail;
    EXPECT_THAT(record.failure_detail, HasSubstr("train.json"));
    EXPECT_THAT(record.failure_detail, HasSubstr("[" + std::to_string(index) + "]"));
    EXPECT_THAT(record.failure_detail, HasSubstr(broken.field));
    EXPECT_THAT(record.failure_detail, HasSubstr("got "));
    EXPECT_THAT(record.failure_detail, HasSubstr("expected "));
  }
}

class BrokenPrima : public ::testing::TestWithParam<Break> {};

TEST_P(BrokenPrima, fails_alone_and_says_why) {
  const Folder folder;
  const std::string good = prima_record().dump();
  const std::string text =
      "{\"data\": [" + good + "," + with_field(prima_record(), GetParam()) + "," + good + "]}";
  expect_failure(folder.load_text("prima", text), 1, GetParam());
}

constexpr const char* kRow25 = "[[1,1,1],[1,1,1]]";

INSTANTIATE_TEST_SUITE_P(
    Fields, BrokenPrima,
    ::testing::Values(
        Break{"img_path", "null", Reason::record_malformed}, Break{"img_path", "3", Reason::record_malformed},
        Break{"img_path", "\"\"", Reason::record_malformed},
        Break{"img_path", "[]", Reason::record_malformed},
        Break{"img_path", "\"images/none.png\"", Reason::image_missing},
        Break{"img_path", "\"../outside.png\"", Reason::path_escapes_root},
        Break{"img_path", "\"images\"", Reason::image_missing},
        Break{"mask_path", "7", Reason::record_malformed},
        Break{"mask_path", "\"../../mask.png\"", Reason::path_escapes_root},
        Break{"bbox", "[1,2,3]", Reason::record_malformed},
        Break{"bbox", "\"1 2 3 4\"", Reason::record_malformed},
        Break{"bbox", "[1,2,3,\"4\"]", Reason::record_malformed},
        Break{"bbox", "[1,2,3,true]", Reason::record_malformed},
        Break{"bbox", "{\"x\":1}", Reason::record_malformed},
        Break{"bbox", "[NaN,2,3,4]", Reason::box_not_finite},
        Break{"bbox", "[1,2,Infinity,4]", Reason::box_not_finite},
        Break{"bbox", "[1,2,1e999,4]", Reason::box_not_finite},
        Break{"bbox", "[1,2,1e300,4]", Reason::box_not_finite},
        Break{"bbox", "[1,2,null,4]", Reason::box_not_finite},
        Break{"bbox", "[8,8,0,26]", Reason::box_zero_size},
        Break{"bbox", "[8,8,36,-1]", Reason::box_zero_size},
        Break{"bbox", "[64,8,5,5]", Reason::box_outside_image},
        Break{"bbox", "[-9,8,5,5]", Reason::box_outside_image},
        Break{"width", "\"wide\"", Reason::record_malformed},
        Break{"width", "[64]", Reason::record_malformed}, Break{"height", "1e12", Reason::record_malformed},
        Break{"height", "1.5", Reason::record_malformed},
        Break{"keypoint_2d", "null", Reason::keypoints_missing},
        Break{"keypoint_2d", "[]", Reason::keypoints_wrong_length},
        Break{"keypoint_2d", kRow25, Reason::keypoints_wrong_length},
        Break{"keypoint_2d", "12", Reason::record_malformed},
        Break{"keypoint_2d", "\"x\"", Reason::record_malformed},
        Break{"keypoint_3d", "[[1,2,3]]", Reason::keypoints_wrong_length},
        Break{"keypoint_3d", "5", Reason::record_malformed}, Break{"pose", "[1,2]", Reason::record_malformed},
        Break{"pose", "\"zeros\"", Reason::record_malformed}, Break{"shape", "[1]", Reason::record_malformed},
        Break{"shape", "{}", Reason::record_malformed},
        Break{"shape_extra", "[1,2,3]", Reason::record_malformed},
        Break{"trans", "[1,2]", Reason::record_malformed},
        Break{"trans", "[1,2,1e99]", Reason::record_malformed},
        Break{"trans", "[1,2,NaN]", Reason::record_malformed},
        Break{"supercategory", "5", Reason::record_malformed},
        Break{"supercategory", "\"horse\"", Reason::record_malformed},
        Break{"supercategory", "1.5", Reason::record_malformed}));

class BrokenKeypoint : public ::testing::TestWithParam<Break> {
};  // the value replaces one row of keypoint_2d

TEST_P(BrokenKeypoint, fails_alone_and_says_which) {
  const Folder folder;
  json record = prima_record();
  record["keypoint_2d"][3] = "@";
  std::string text = json{{"data", {prima_record(), record}}}.dump();
  text.replace(text.find("\"@\""), 3, GetParam().value);
  const Dataset dataset = folder.load_text("prima", text);
  expect_failure(dataset, 1, GetParam());
  EXPECT_THAT(dataset.records[1].failure_detail, HasSubstr("keypoint_2d[3]"));
}

INSTANTIATE_TEST_SUITE_P(
    Rows, BrokenKeypoint,
    ::testing::Values(Break{"keypoint_2d", "[1,2]", Reason::keypoints_wrong_length},
                      Break{"keypoint_2d", "[1,2,3,4]", Reason::keypoints_wrong_length},
                      Break{"keypoint_2d", "5", Reason::keypoints_wrong_length},
                      Break{"keypoint_2d", "null", Reason::keypoints_wrong_length},
                      Break{"keypoint_2d", "[1,\"2\",1]", Reason::record_malformed},
                      Break{"keypoint_2d", "[1,[2],1]", Reason::record_malformed},
                      Break{"keypoint_2d", "[NaN,2,1]", Reason::keypoints_not_finite},
                      Break{"keypoint_2d", "[1,-Infinity,2]", Reason::keypoints_not_finite},
                      Break{"keypoint_2d", "[1,1e400,1]", Reason::keypoints_not_finite},
                      Break{"keypoint_2d", "[1,2e7,1]", Reason::keypoints_not_finite},
                      Break{"keypoint_2d", "[1,2,Infinity]", Reason::keypoints_not_finite}));

TEST(Prima, records_of_another_type_fail_alone) {
  const Folder folder;
  const std::string good = prima_record().dump();
  const Dataset dataset = folder.load_text("prima", "{\"data\": [3, null, \"x\", [1], {}, " + good + "]}");
  ASSERT_EQ(dataset.records.size(), 6U);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(dataset.records[i].failure, Reason::record_malformed);
    EXPECT_THAT(dataset.records[i].failure_detail, HasSubstr("data[" + std::to_string(i) + "]"));
    EXPECT_EQ(dataset.records[i].id, "set/train/#" + std::to_string(i));
  }
  EXPECT_EQ(dataset.records[5].failure, Reason::none);
}

class BrokenSuperAnimal : public ::testing::TestWithParam<Break> {};

TEST_P(BrokenSuperAnimal, fails_alone_and_says_why) {
  const Folder folder;
  json document = superanimal_document(3);
  document["annotations"][1][GetParam().field] = "@";
  std::string text = document.dump();
  text.replace(text.find("\"@\""), 3, GetParam().value);
  expect_failure(folder.load_text("superanimal", text), 1, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Fields, BrokenSuperAnimal,
                         ::testing::Values(Break{"image_id", "null", Reason::image_not_listed},
                                           Break{"image_id", "99999", Reason::image_not_listed},
                                           Break{"image_id", "\"99999\"", Reason::image_not_listed},
                                           Break{"image_id", "true", Reason::record_malformed},
                                           Break{"image_id", "1.5", Reason::record_malformed},
                                           Break{"bbox", "null", Reason::box_missing},
                                           Break{"bbox", "[]", Reason::record_malformed},
                                           Break{"bbox", "[1,2,3,NaN]", Reason::box_not_finite},
                                           Break{"bbox", "[900,8,5,5]", Reason::box_outside_image},
                                           Break{"keypoints", "null", Reason::keypoints_missing},
                                           Break{"keypoints", "[1,2,2]", Reason::keypoints_wrong_length},
                                           Break{"keypoints", "{}", Reason::record_malformed}));

TEST(SuperAnimal, a_broken_image_entry_fails_its_annotations_alone) {
  const Folder folder;
  for (const json& file_name : {json(), json(5), json(""), json("none.png")}) {
    json document = superanimal_document(2);
    document["images"][0]["file_name"] = file_name;
    const Dataset dataset = folder.load("superanimal", document);
    EXPECT_NE(dataset.records[0].failure, Reason::none);
    EXPECT_THAT(dataset.records[0].failure_detail, HasSubstr("the image of id 100.file_name"));
    EXPECT_EQ(dataset.records[1].failure, Reason::none) << dataset.records[1].failure_detail;
  }
  json document = superanimal_document(2);
  document["images"][0] = "no object";
  EXPECT_EQ(folder.load("superanimal", document).records[0].failure, Reason::image_not_listed);
}

class BrokenKingdom : public ::testing::TestWithParam<Break> {};

TEST_P(BrokenKingdom, fails_alone_and_says_why) {
  const Folder folder;
  const std::string good = kingdom_record().dump();
  expect_failure(
      folder.load_text("animal_kingdom", "[" + good + "," + with_field(kingdom_record(), GetParam()) + "]"),
      1, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Fields, BrokenKingdom,
                         ::testing::Values(Break{"image", "null", Reason::record_malformed},
                                           Break{"image", "\"BBBB/BBBB_f000001.png\"", Reason::image_missing},
                                           Break{"animal", "4", Reason::record_malformed},
                                           Break{"center", "null", Reason::box_missing},
                                           Break{"center", "[1]", Reason::record_malformed},
                                           Break{"center", "[NaN, 2]", Reason::box_not_finite},
                                           Break{"scale", "null", Reason::box_missing},
                                           Break{"scale", "\"big\"", Reason::record_malformed},
                                           Break{"scale", "0", Reason::box_zero_size},
                                           Break{"scale", "1e30", Reason::box_not_finite},
                                           Break{"joints", "[[1,2]]", Reason::keypoints_wrong_length},
                                           Break{"joints", "null", Reason::keypoints_missing},
                                           Break{"joints_vis", "[1]", Reason::keypoints_wrong_length},
                                           Break{"joints_vis",
                                                 "[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]",
                                                 Reason::no_visible_keypoints}));

// Points lie in (10, 10)..(40, 30), and a box has a margin of a tenth of its longer side.
TEST(Prima, a_box_that_nobody_drew_is_made_around_the_keypoints) {
  const Folder folder;
  for (const json& box : {json(), json(json::array()), json({0, 0, 0, 0}), json({8, 8, 0, 0})}) {
    json record = prima_record();
    record["bbox"] = box;
    const Dataset dataset = folder.load_prima({record});
    ASSERT_EQ(dataset.records[0].failure, Reason::none) << box << dataset.records[0].failure_detail;
    EXPECT_NEAR(dataset.records[0].box.x_px, 7.0, 1e-9) << box;
    EXPECT_NEAR(dataset.records[0].box.w_px, 36.0, 1e-9) << box;
    EXPECT_THAT(joined(dataset.notes), ::testing::HasSubstr("no box: it was made around the keypoints"));
  }
  json nothing = prima_record();
  nothing["bbox"] = nullptr;
  for (json& row : nothing["keypoint_2d"]) row[2] = 0;
  EXPECT_EQ(folder.load_prima({nothing}).records[0].failure, Reason::box_missing);
}

}  // namespace
}  // namespace q3d::loaders::formats
