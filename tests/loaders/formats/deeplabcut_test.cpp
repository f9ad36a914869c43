// DeepLabCut's files, as pandas wrote them (tests/data/deeplabcut/make.py says with what numbers).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "loaders/formats/label_table.h"
#include "loaders/formats/pickled_names.h"
#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Family;
using manifests::Reason;
using manifests::SampleRecord;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::size_t kLeftEye = 0;
constexpr std::size_t kRightEye = 1;
constexpr std::size_t kNose = 24;

std::filesystem::path made(const std::string& name) {
  return q3d::testing::data_dir() / "deeplabcut" / name;
}

// A project: pictures of the names that the labels use, a topology, and one of the made files.
struct Project {
  Project() {
    for (const char* name : {"img000.png", "img002.png", "img007.png"}) {
      write_picture(root() / "labeled-data/walk" / name);
    }
    for (const char* name : {"clip0000.png", "clip0001.png"}) write_picture(root() / "frames" / name);
    write_text(root() / "goats.json",
               json{{"name", "goats"},
                    {"keypoints", {"eye_l", "eye_r", "snout", "horn"}},
                    {"flip_pairs", json::array({json::array({"eye_l", "eye_r"})})},
                    {"animal3d26", {{"left_eye", "eye_l"}, {"right_eye", "eye_r"}, {"nose", "snout"}}}}
                   .dump());
    options = {.name = "lab",
               .format = "deeplabcut",
               .split = "train",
               .root = root(),
               .annotations = {},
               .images = {},
               .topology = root() / "goats.json",
               .species = "goat"};
  }
  std::filesystem::path root() const { return scratch.path() / "project"; }
  Dataset load(const std::string& file) {
    options.annotations = made(file);
    return load_dataset(options);
  }
  q3d::testing::ScratchDir scratch;
  DatasetOptions options;
};

class SingleAnimal : public ::testing::TestWithParam<const char*> {};

TEST_P(SingleAnimal, labels_are_one_record_a_picture) {
  Project project;
  const Dataset dataset = project.load(GetParam());
  ASSERT_EQ(dataset.records.size(), 3U);
  const SampleRecord& first = dataset.records[0];
  ASSERT_EQ(first.failure, Reason::none) << first.failure_detail;
  EXPECT_EQ(first.id, "lab/train/labeled-data/walk/img002.png#0");
  EXPECT_EQ(first.species, "goat");
  EXPECT_EQ(first.family, Family::bovidae);
  EXPECT_EQ(first.keypoints[kNose].x_px, 0.0);
  EXPECT_EQ(first.keypoints[kNose].y_px, 100.0);
  EXPECT_EQ(first.keypoints[kRightEye].x_px, 20.0);
  EXPECT_EQ(first.keypoints[kRightEye].v, 1.0F);
  EXPECT_EQ(first.keypoints[kRightEye].weight, 1.0F);
  // Four points from (0, 100) to (30, 130), 0.1 * 30 wider on each side.
  EXPECT_DOUBLE_EQ(first.box.x_px, -3.0);
  EXPECT_DOUBLE_EQ(first.box.y_px, 97.0);
  EXPECT_DOUBLE_EQ(first.box.w_px, 36.0);
  EXPECT_DOUBLE_EQ(first.box.h_px, 36.0);
  EXPECT_EQ(dataset.records[1].keypoints[kLeftEye].weight, 0.0F) << "not labelled";
  EXPECT_EQ(dataset.records[1].keypoints[kRightEye].x_px, 21.0);
}

INSTANTIATE_TEST_SUITE_P(BothFiles, SingleAnimal, ::testing::Values("labels.h5", "labels.csv"));

class SeveralAnimals : public ::testing::TestWithParam<const char*> {};

TEST_P(SeveralAnimals, one_record_an_individual_that_is_there) {
  Project project;
  const Dataset dataset = project.load(GetParam());
  std::vector<std::string> ids;
  for (const SampleRecord& record : dataset.records) ids.push_back(record.id);
  EXPECT_THAT(ids, ElementsAre("lab/train/labeled-data/walk/img002.png#goat1",
                               "lab/train/labeled-data/walk/img002.png#goat2",
                               "lab/train/labeled-data/walk/img000.png#goat1"));
  EXPECT_EQ(dataset.records[1].keypoints[kNose].x_px, 1000.0);
  EXPECT_EQ(dataset.records[1].keypoints[kRightEye].y_px, 1120.0);
  EXPECT_EQ(dataset.records[2].keypoints[kNose].x_px, 1.0);
  EXPECT_EQ(dataset.records[2].failure, Reason::none) << dataset.records[2].failure_detail;
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("individuals that have no keypoint in a frame and are left out there: 3"));
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("keypoints that belong to no animal (individual \"single\") are left out: 1"));
}

INSTANTIATE_TEST_SUITE_P(BothFiles, SeveralAnimals, ::testing::Values("labels_multi.h5", "labels_multi.csv"));

class Predictions : public ::testing::TestWithParam<const char*> {};

// Likelihoods are 0.95, 0.7, 0.45 and 0.2 for snout, eye_l, eye_r and horn.
TEST_P(Predictions, likelihoods_are_weights_and_frames_find_their_pictures) {
  Project project;
  project.options.images = "frames";
  const Dataset dataset = project.load(GetParam());
  ASSERT_EQ(dataset.records.size(), 3U);
  const SampleRecord& record = dataset.records[1];
  ASSERT_EQ(record.failure, Reason::none) << record.failure_detail;
  EXPECT_EQ(record.id, "lab/train/clip0001.png#0");
  EXPECT_EQ(record.keypoints[kNose].v, 0.95F);
  EXPECT_EQ(record.keypoints[kNose].weight, 0.95F);
  EXPECT_EQ(record.keypoints[kLeftEye].x_px, 11.0);
  EXPECT_EQ(record.keypoints[kRightEye].v, 0.45F);
  EXPECT_EQ(record.keypoints[kRightEye].weight, 0.0F);
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("which becomes their weight: 12; of these, below min_confidence 0.6 "
                        "(weight 0): 6"));
  EXPECT_EQ(dataset.records[2].failure, Reason::image_missing) << "there is no frame 2";
  project.options.min_confidence = 0.97;
  EXPECT_EQ(project.load(GetParam()).records[1].failure, Reason::no_visible_keypoints);
}

INSTANTIATE_TEST_SUITE_P(BothFiles, Predictions, ::testing::Values("predictions.h5", "predictions.csv"));

TEST(DeepLabCut, predictions_of_several_animals) {
  Project project;
  project.options.images = "frames";
  const Dataset dataset = project.load("predictions_multi.h5");
  ASSERT_EQ(dataset.records.size(), 6U);
  EXPECT_EQ(dataset.records[3].id, "lab/train/clip0001.png#goat2");
  EXPECT_EQ(dataset.records[3].keypoints[kLeftEye].x_px, 1011.0);
  EXPECT_EQ(dataset.records[3].keypoints[kLeftEye].weight, 0.7F);
}

TEST(DeepLabCut, a_folder_gives_all_labels_of_the_project) {
  Project project;
  const auto labels = project.root() / "labeled-data";
  std::filesystem::copy(made("labels.h5"), labels / "walk/CollectedData_Ada.h5");
  std::filesystem::copy(made("labels.csv"), labels / "walk/CollectedData_Ada.csv");  // the same labels
  write_picture(labels / "run/img1.png");
  write_text(labels / "run/CollectedData_Ada.csv",
             "scorer,Ada,Ada,Ada,Ada,Ada,Ada,Ada,Ada\r\n"
             "bodyparts,horn,horn,snout,snout,eye_r,eye_r,eye_l,eye_l\r\n"
             "coords,x,y,x,y,x,y,x,y\r\n"
             "\"labeled-data\\run\\img1.png\",1,2,3,4,50,60,,\r\n");
  project.options.annotations = "labeled-data";
  const Dataset dataset = load_dataset(project.options);
  ASSERT_EQ(dataset.records.size(), 4U);
  EXPECT_EQ(dataset.records[0].id, "lab/train/labeled-data/run/img1.png#0");
  EXPECT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_EQ(dataset.records[0].keypoints[kNose].x_px, 3.0);
  EXPECT_EQ(dataset.files.size(), 4U)
      << "two files of labels, the .csv that one of them is compared with, and the topology";
  project.options.annotations = "frames";
  EXPECT_THROW(load_dataset(project.options), std::runtime_error);
}

TEST(DeepLabCut, a_picture_in_two_rows_is_told_apart_by_number) {
  Project project;
  const std::string header =
      "scorer,A,A,A,A,A,A,A,A\nbodyparts,snout,snout,eye_l,eye_l,eye_r,eye_r,horn,horn\n"
      "coords,x,y,x,y,x,y,x,y\n";
  const std::string row = "labeled-data/walk/img000.png,1,2,3,4,5,6,7,8\n";
  write_text(project.root() / "twice.csv", header + row + row);
  project.options.annotations = "twice.csv";
  const Dataset dataset = load_dataset(project.options);
  EXPECT_EQ(dataset.records[0].id, "lab/train/labeled-data/walk/img000.png#0");
  EXPECT_EQ(dataset.records[1].id, "lab/train/labeled-data/walk/img000.png#1");
}

// Ids and notes are written as JSON, which holds UTF-8 alone.
TEST(DeepLabCut, a_folder_whose_name_is_no_utf8_fails_its_records) {
  Project project;
  const auto labels = project.root() / "labeled-data/caf\xe9";
  write_picture(labels / "img1.png");
  for (const char* name : {"CollectedData_Ada.csv", "CollectedData_Adawindows.csv"}) {
    write_text(labels / name,
               "scorer,A,A,A,A,A,A,A,A\nbodyparts,snout,snout,eye_l,eye_l,eye_r,eye_r,horn,horn\n"
               "coords,x,y,x,y,x,y,x,y\nimg1.png,1,2,3,4,50,60,7,8\n");
  }
  project.options.annotations = "labeled-data";
  const Dataset dataset = load_dataset(project.options);
  ASSERT_EQ(dataset.records.size(), 1U);
  const SampleRecord& record = dataset.records[0];
  EXPECT_EQ(record.failure, Reason::record_malformed);
  EXPECT_EQ(record.id, "lab/train/labeled-data/caf\\xe9/img1.png#0");
  EXPECT_EQ(record.image_ref, "labeled-data/caf\\xe9/img1.png");
  EXPECT_THAT(record.failure_detail,
              HasSubstr("got \"labeled-data/caf\\xe9/img1.png\", a name with bytes that are no UTF-8"));
  EXPECT_NO_THROW(json(record.failure_detail).dump());
  EXPECT_THAT(joined(dataset.notes), HasSubstr("caf\\xe9: CollectedData_Ada.csv is read"));
  EXPECT_NO_THROW(json(joined(dataset.notes)).dump());
}

TEST(LabelHdf5, refuses_what_is_no_frame) {
  const q3d::testing::ScratchDir scratch;
  const std::string whole = [] {
    std::ifstream stream(made("labels.h5"), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  }();
  write_text(scratch.path() / "cut.h5", whole.substr(0, whole.size() / 2));
  EXPECT_THROW(read_label_table(scratch.path() / "cut.h5"), std::runtime_error);
  // Every eighth byte is damaged in turn: the file is read or refused, and what is read has a whole table.
  for (std::size_t at = 0; at < whole.size(); at += 8) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x5A);
    write_text(scratch.path() / "damaged.h5", damaged);
    try {
      const LabelTable table = read_label_table(scratch.path() / "damaged.h5");
      EXPECT_EQ(table.values.size(), table.rows.size() * table.columns.size());
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("damaged.h5"));
    }
  }
}

// Python: pickle.dumps([(1, [("Ada", "Schnauze\u00e9\u4e2d", "x")])], 0)
TEST(PickledNames, reads_texts_and_shares_the_memo) {
  const std::string pickle =
      "(lp0\n(I1\n(lp1\n(VAda\np2\nVSchnauze\xe9\\u4e2d\np3\nVx\np4\ntp5\na(g2\ng3\nVy\np6\ntp7\natp8\na.";
  const auto columns = read_pickled_columns(pickle, "here");
  ASSERT_EQ(columns.size(), 2U);
  EXPECT_THAT(columns[0], ElementsAre("Ada", "Schnauze\u00e9\u4e2d", "x"));
  EXPECT_THAT(columns[1], ElementsAre("Ada", "Schnauze\u00e9\u4e2d", "y"));
}

TEST(PickledNames, refuses_code_and_other_shapes) {
  const auto refusal = [](const std::string& pickle) -> std::string {
    try {
      read_pickled_columns(pickle, "here");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("cos\nsystem\n(Vecho\ntR."),
              HasSubstr("here: byte 1 of its pickle: got the opcode 0x63"));
  EXPECT_THAT(refusal("(lp0\ng0\na."), HasSubstr("got an item for a list that is already part of another"))
      << "a list within itself";
  EXPECT_THAT(refusal("(lp0\n(I1\n"), HasSubstr("its end"));
  EXPECT_THAT(refusal("a."), HasSubstr("nothing on the stack"));
  EXPECT_THAT(refusal("g7\n."), HasSubstr("the memo 7"));
  EXPECT_THAT(refusal("l."), HasSubstr("no mark"));
  EXPECT_THAT(refusal("(lp0\n."), HasSubstr("a pickle of another form"));
  EXPECT_THAT(refusal("(lp0\n(I1\n(lp1\nI3\natp2\na."), HasSubstr("a pickle of another form"));
}

// A few bytes that claim much: a million lists within each other, and a name that thousands of tuples repeat.
TEST(PickledNames, what_a_pickle_can_claim_is_bounded) {
  const auto refusal = [](const std::string& pickle) -> std::string {
    try {
      read_pickled_columns(pickle, "here");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(std::string(1'000'000, '(') + std::string(1'000'000, 'l') + "."),
              HasSubstr("got lists that are nested too deeply, expected at most 4"));
  const auto columns = [](const std::string& name, int names, int tuples) {
    std::string pickle = "(lp0\n(I1\n(lp1\n(V" + name + "\np2\n";
    for (int i = 1; i < names; ++i) pickle += "g2\n";
    pickle += "tp3\na";
    for (int i = 1; i < tuples; ++i) pickle += "g3\na";
    return pickle + "tp4\na.";
  };
  EXPECT_EQ(read_pickled_columns(columns("snout", 8, 3), "here"),
            std::vector(3, std::vector<std::string>(8, "snout")));
  EXPECT_THAT(refusal(columns("snout", 9, 1)), HasSubstr("at most 8 names in a tuple"));
  EXPECT_THAT(refusal(columns(std::string(1001, 'x'), 1, 1)), HasSubstr("1000 bytes in a name"));
  EXPECT_THAT(refusal(columns("snout", 1, 100'001)), HasSubstr("a pickle of another form"));
}

}  // namespace
}  // namespace q3d::loaders::formats
