// DeepLabCut's CSV as DeepLabCut writes it, and as spreadsheets and pandas leave it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "loaders/formats/label_table.h"
#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using ::testing::ElementsAre;
using ::testing::HasSubstr;

LabelTable read(const std::string& text) {
  const q3d::testing::ScratchDir scratch;
  write_text(scratch.path() / "labels.csv", text);
  return read_label_table(scratch.path() / "labels.csv");
}

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

const std::string kHeader = "scorer,A,A\nbodyparts,snout,snout\ncoords,x,y\n";

TEST(LabelCsv, names_line_and_cell_of_what_it_cannot_read) {
  EXPECT_EQ(refusal(kHeader), "");
  EXPECT_EQ(refusal(kHeader + "a.png,1,\n"), "");
  EXPECT_THAT(refusal(""), HasSubstr("got an empty file"));
  EXPECT_THAT(refusal("Frame,b\n1,2\n"),
              HasSubstr("line 1: got \"Frame\" in the first cell, expected \"scorer\""));
  EXPECT_THAT(refusal("bodyparts,snout\ncoords,x\n"),
              HasSubstr("header rows that begin with bodyparts, coords"));
  EXPECT_THAT(refusal("scorer,A,A\ncoords,x,y\nbodyparts,snout,snout\n"),
              HasSubstr("scorer, coords, bodyparts"));
  EXPECT_THAT(refusal(kHeader + "a.png,1,left\n"), HasSubstr("line 4: got \"left\" for y of snout"));
  EXPECT_THAT(refusal(kHeader + "a.png,1,2,3\n"), HasSubstr("line 4: got \"3\" in cell 4"));
  EXPECT_THAT(refusal(kHeader + "\"a.png,1,2\n"), HasSubstr("a quote that is not closed"));
  EXPECT_THAT(refusal("scorer,A,A\nbodyparts,snout,snout\ncoords,x,z\n"), HasSubstr("coords: got \"z\""));
  EXPECT_THAT(refusal("scorer,A,A\nbodyparts,L\xf6hr,L\xf6hr\ncoords,x,y\n"), HasSubstr("CSV UTF-8"));
  EXPECT_THAT(refusal(kHeader + "H\xfcndin.png,1,2\n"), HasSubstr("a name of a picture"));
}

TEST(LabelCsv, names_files_of_other_tools) {
  EXPECT_THAT(refusal("track,frame_idx,instance.score,nose.x\n,0,1,2\n"), HasSubstr("SLEAP's analysis CSV"));
  EXPECT_THAT(refusal("0 0.51 0.5 0.3 0.2 0.4 0.4 2\n"), HasSubstr("YOLO"));
  EXPECT_THAT(refusal("{\"images\": []}\n"), HasSubstr("\"format\": \"coco\""));
  EXPECT_THAT(refusal("Task: walk\nscorer: Ada\n"), HasSubstr("name the folder labeled-data"));
  EXPECT_THAT(refusal("sep=;\nscorer;A\n"), HasSubstr("Excel's own first line"));
  EXPECT_THAT(refusal("version https://git-lfs.github.com/spec/v1\n"), HasSubstr("git lfs pull"));
}

// The same table in the forms that it takes on its way through other programs.
class Form : public ::testing::TestWithParam<const char*> {};

TEST_P(Form, is_the_same_table) {
  const LabelTable table = read(GetParam());
  EXPECT_THAT(table.rows, ElementsAre("d/w/a.png", "d/w/b.png"));
  ASSERT_EQ(table.columns.size(), 2U);
  EXPECT_EQ(table.columns[1].bodypart, "snout");
  EXPECT_EQ(table.columns[1].coordinate, "y");
  EXPECT_EQ(table.at(0, 0), 1.5);
  EXPECT_EQ(table.at(0, 1), 2.0);
  EXPECT_EQ(table.at(1, 0), 3.25);
  EXPECT_TRUE(std::isnan(table.at(1, 1)));
  EXPECT_FALSE(table.rows_are_numbers);
}

INSTANTIATE_TEST_SUITE_P(
    OfOneTable, Form,
    ::testing::Values(
        "scorer,,,A,A\nbodyparts,,,snout,snout\ncoords,,,x,y\nd,w,a.png,1.5,2\nd,w,b.png,3.25,\n",
        "\xef\xbb\xbfscorer,,,A,A\nbodyparts,,,snout,snout\ncoords,,,x,y\nd,w,a.png,1.5,2\nd,w,b.png,3.25,\n",
        "scorer;;;A;A\nbodyparts;;;snout;snout\ncoords;;;x;y\nd;w;a.png;1.5;2\nd;w;b.png;3.25;\n",
        "scorer;;;A;A\r\nbodyparts;;;snout;snout\r\ncoords;;;x;y\r\nd;w;a.png;1,5;2,0\r\nd;w;b.png;3,25;\r\n",
        "scorer\t\t\tA\tA\nbodyparts\t\t\tsnout\tsnout\ncoords\t\t\tx\ty\nd\tw\ta.png\t1,5\t2\nd\tw\tb."
        "png\t3,25\t\n",
        "scorer,,,A,A,,\nbodyparts,,,snout,snout,,\ncoords,,,x,y,,\nd,w,a.png,1.5,2,,\nd,w,b.png,3.25,,,\n,,,"
        ",,,\n",
        "scorer,,,A,A\nbodyparts,,,snout,snout\ncoords,,,x,y\nd,w,a.png,1.5,2\nd,w,b.png,3.25\n",
        "scorer,,,A,A\nbodyparts,,,snout,snout\ncoords,,,x,y\nd,w,a.png, 1.5 ,2,,\nd,w,b.png,3.25,NaN\n",
        "scorer,Unnamed: 1_level_0,Unnamed: 2_level_0,A,A\nbodyparts,Unnamed: 1_level_1,Unnamed: "
        "2_level_1,snout,snout\ncoords,Unnamed: 1_level_2,Unnamed: "
        "2_level_2,x,y\nd,w,a.png,1.5,2\nd,w,b.png,3.25,NA\n",
        "scorer,A,A\nbodyparts,snout,snout\ncoords,x,y\n\"('d', 'w', 'a.png')\",1.5,2\nd\\w\\b.png,3.25,\n",
        "scorer,,,A,A\nbodyparts,,,snout,snout\ncoords,,,x,y\nd/w/a.png,,,1.5,2\n\"(\"\"d\"\", 'w', "
        "'b.png')\",,,3.25,\n",
        "scorer,,,A,,A\nbodyparts,,,snout,,snout\ncoords,,,x,,y\nd,w,a.png,1.5,,2\nd,w,b.png,3.25,,\n"));

TEST(LabelCsv, utf16_of_a_spreadsheet) {
  std::string wide = "\xff\xfe";
  for (const char c : std::string("scorer\tA\tA\nbodyparts\tsnout\tsnout\ncoords\tx\ty\n7\t1,5\t2\n")) {
    wide += c;
    wide += '\0';
  }
  const LabelTable table = read(wide);
  EXPECT_TRUE(table.rows_are_numbers);
  EXPECT_EQ(table.at(0, 0), 1.5);
}

// A row of the header that slipped by a cell gives every label to another keypoint.
TEST(LabelCsv, a_row_of_the_header_that_slipped_is_refused) {
  const std::string good = "scorer,A,A,A,A\nindividuals,i,i,i,i\nbodyparts,a,a,b,b\ncoords,x,y,x,y\n";
  EXPECT_EQ(refusal(good + "a.png,1,2,3,4\n"), "");
  for (const char* header : {"scorer,A,A,A,A\nindividuals,i,i,i,i\nbodyparts,b,a,a,b\ncoords,x,y,x,y\n",
                             "scorer,A,A,A,A\nindividuals,i,i,i,i\nbodyparts,a,a,b,b\ncoords,y,x,y,x\n",
                             "scorer,A,A,A,A\nindividuals,i,i,i,j\nbodyparts,a,a,b,b\ncoords,x,y,x,y\n"}) {
    EXPECT_THAT(refusal(std::string(header) + "a.png,1,2,3,4\n"), HasSubstr("slipped against the others"));
  }
  EXPECT_EQ(refusal("scorer,A,A,A\nbodyparts,a,a,a\ncoords,likelihood,x,y\na.png,1,2,3\n"), "")
      << "pandas sorted the columns";
}

TEST(LabelCsv, the_name_of_the_index_is_no_row) {
  const LabelTable table = read(kHeader + "frame,,\n0,1,2\n1,3,4\n");
  EXPECT_THAT(table.rows, ElementsAre("0", "1"));
  EXPECT_TRUE(table.rows_are_numbers);
  EXPECT_EQ(table.at(1, 1), 4.0);
  EXPECT_THAT(read(kHeader + "a.png,,\nb.png,1,2\n").rows, ElementsAre("a.png", "b.png"));
  EXPECT_THAT(read(kHeader + "frame,,\n").rows, ::testing::IsEmpty());
}

}  // namespace
}  // namespace q3d::loaders::formats
