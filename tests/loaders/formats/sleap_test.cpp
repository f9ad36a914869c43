// SLEAP's tables, and its CSV. Its HDF5 files are read in tests/pipeline/foreign_labels_end_to_end.py, which
// writes them with h5py.
#include "loaders/formats/sleap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The individuals of the table, each once.
std::vector<std::string> individuals(const LabelTable& table) {
  std::vector<std::string> names;
  for (const LabelColumn& column : table.columns) {
    if (names.empty() || names.back() != column.individual) names.push_back(column.individual);
  }
  return names;
}

TEST(SleapTable, tracks_are_individuals_and_others_are_numbered_in_their_frame) {
  SleapTable table({"nose"}, {"ada", "bob"});
  table.begin_frame("0");
  table.add_animal(1, {{1, 2, 0.5}});
  table.add_animal({}, {{3, 4, 1.0}});
  table.add_animal(1, {{5, 6, 1.0}});  // a second animal of the same track
  table.begin_frame("7");              // nobody
  table.begin_frame("9");
  table.add_animal(0, {{kNaN, kNaN, 1.0}});  // no labelled point
  table.add_animal({}, {{7, 8, 1.03}});      // a score above 1 counts as 1
  const LabelTable made = table.finish(true);
  EXPECT_THAT(individuals(made), ElementsAre("bob", "animal_0", "animal_1"));
  EXPECT_THAT(made.rows, ElementsAre("0", "9"));
  EXPECT_TRUE(made.rows_are_numbers);
  EXPECT_EQ(made.at(0, 0), 1.0);
  EXPECT_EQ(made.at(0, 2), 0.5);
  EXPECT_EQ(made.at(0, 3), 3.0);
  EXPECT_EQ(made.at(0, 6), 5.0);
  EXPECT_TRUE(std::isnan(made.at(1, 0)));
  EXPECT_EQ(made.at(1, 4), 8.0);
  EXPECT_EQ(made.at(1, 5), 1.0);
}

TEST(SleapTable, a_single_animal_has_no_name) {
  SleapTable table({"nose"}, {"only"});
  table.begin_frame("0");
  table.add_animal(0, {{1, 2, 1.0}});
  EXPECT_THAT(individuals(table.finish(true)), ElementsAre(""));
}

// "single" is DeepLabCut's word for points of no animal, and the names become parts of sample ids.
TEST(SleapTable, names_of_tracks_are_made_fit) {
  SleapTable table({"nose"}, {"single", "a/b#c", "same", "same"});
  table.begin_frame("0");
  for (std::size_t track = 0; track < 4; ++track) table.add_animal(track, {{1, 2, 1.0}});
  EXPECT_THAT(individuals(table.finish(true)), ElementsAre("single_0", "a_b_c", "same_2", "same_3"));
}

TEST(SleapCsv, is_recognised_and_read) {
  const std::string text =
      "track,frame_idx,instance.score,nose.x,nose.y,nose.score,tail.base.x,tail.base.y,tail.base.score\n"
      "ada,3,0.9,10,11,0.8,12,13,0.7\n"
      "bob,3,0.9,20,21,0.6,,,\n"
      "ada,1,0.9,30,31,0.5,32,33,0.4\n";
  ASSERT_TRUE(is_sleap_csv(text));
  const LabelTable table = read_sleap_csv(text, "a.csv");
  EXPECT_THAT(table.rows, ElementsAre("1", "3"));  // frames in order, whatever the order of the lines
  EXPECT_TRUE(table.rows_are_numbers);
  EXPECT_THAT(individuals(table), ElementsAre("ada", "bob"));
  EXPECT_EQ(table.columns[3].bodypart, "tail.base");
  EXPECT_EQ(table.at(0, 0), 30.0);
  EXPECT_EQ(table.at(1, 4), 13.0);
  EXPECT_EQ(table.at(1, 6), 20.0);
  EXPECT_TRUE(std::isnan(table.at(1, 9)));
  EXPECT_FALSE(is_sleap_csv("scorer,a,a\nbodyparts,b,b\ncoords,x,y\n"));
}

TEST(SleapCsv, a_frame_without_a_number_is_refused) {
  for (const char* frame : {"", "1.5", "-1"}) {
    const std::string text = std::string("track,frame_idx,nose.x,nose.y\na,") + frame + ",1,2\n";
    EXPECT_THROW(read_sleap_csv(text, "a.csv"), std::runtime_error) << frame;
  }
}

// Predictions of Lightning Pose end with a column of words, which set a frame belongs to.
TEST(LightningPose, the_column_of_the_set_is_left_out) {
  const q3d::testing::ScratchDir scratch;
  const auto file = scratch.path() / "predictions.csv";
  write_text(file,
             "scorer,heatmap_tracker,heatmap_tracker,heatmap_tracker,set\n"
             "bodyparts,nose,nose,nose,\n"
             "coords,x,y,likelihood,\n"
             "labeled-data/a.png,1,2,0.9,train\n"
             "labeled-data/b.png,3,4,0.8,validation\n");
  const LabelTable table = read_label_table(file);
  ASSERT_EQ(table.columns.size(), 3U);
  EXPECT_THAT(table.rows, ElementsAre("labeled-data/a.png", "labeled-data/b.png"));
  EXPECT_EQ(table.at(1, 0), 3.0);
  EXPECT_EQ(table.at(1, 2), 0.8);
}

}  // namespace
}  // namespace q3d::loaders::formats
