// The names of keypoints, read from label files of each kind.
#include "loaders/formats/label_survey.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class Survey : public ::testing::Test {
 protected:
  LabelSurvey of(const std::string& name, const std::string& text) const {
    write_text(scratch_.path() / name, text);
    return survey_labels(scratch_.path() / name);
  }
  std::string refusal(const std::string& name, const std::string& text) const {
    try {
      of(name, text);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "nothing thrown";
  }
  q3d::testing::ScratchDir scratch_;
};

json coco(const std::vector<json>& lists) {
  json document = {{"images", json::array()}, {"annotations", json::array()}, {"categories", json::array()}};
  for (const json& names : lists)
    document["categories"].push_back({{"id", 1}, {"name", "goat"}, {"keypoints", names}});
  return document;
}

TEST_F(Survey, coco_lists_names_in_its_categories) {
  const LabelSurvey survey = of("a.json", coco({{"nose", "eye_l"}}).dump());
  EXPECT_THAT(survey.names, ElementsAre("nose", "eye_l"));
  EXPECT_EQ(survey.format, "coco");
  const LabelSurvey two = of("b.json", coco({{"nose", "eye_l"}, {"nose", "horn"}}).dump());
  EXPECT_THAT(two.names, ElementsAre("nose", "eye_l", "horn"));
  EXPECT_THAT(two.notes, SizeIs(1));
  EXPECT_THAT(refusal("c.json", coco({json::array()}).dump()), HasSubstr("got none that lists the names"));
}

TEST_F(Survey, labelme_names_its_points) {
  const json shapes = {{{"label", "nose"}, {"shape_type", "point"}},
                       {{"label", "goat"}, {"shape_type", "rectangle"}},
                       {{"label", "eye_l"}, {"shape_type", "point"}}};
  const LabelSurvey survey = of("one.json", json{{"shapes", shapes}}.dump());
  EXPECT_THAT(survey.names, ElementsAre("nose", "eye_l"));
  EXPECT_EQ(survey.format, "");
  write_text(scratch_.path() / "two.json",
             json{{"shapes", {{{"label", "horn"}, {"shape_type", "point"}}}}}.dump());
  EXPECT_THAT(survey_labels(scratch_.path()).names, ElementsAre("nose", "eye_l", "horn"));
}

TEST_F(Survey, tables_name_their_bodyparts) {
  const LabelSurvey survey = of("CollectedData_A.csv",
                                "scorer,A,A,A,A,A,A\n"
                                "individuals,goat1,goat1,goat2,goat2,single,single\n"
                                "bodyparts,nose,nose,nose,nose,horn,horn\n"
                                "coords,x,y,x,y,x,y\n"
                                "img0.png,1,2,3,4,5,6\n");
  EXPECT_THAT(survey.names, ElementsAre("nose"));  // "horn" belongs to no animal
  EXPECT_EQ(survey.format, "deeplabcut");
  EXPECT_THAT(survey_labels(scratch_.path()).names, ElementsAre("nose"));  // the folder of a project
  EXPECT_EQ(of("clip.csv", "track,frame_idx,instance.score,nose.x,nose.y,nose.score\n,0,1,2,3,0.9\n").format,
            "sleap");
}

TEST_F(Survey, known_keypoints_need_no_topology) {
  EXPECT_THAT(refusal("p.json", R"({"data": []})"), HasSubstr("\"format\": \"prima\", without a topology"));
  EXPECT_THAT(refusal("s.json", R"([{"img_path": "a", "joints": []}])"), HasSubstr("stanfordextra"));
  EXPECT_THAT(refusal("b.json", R"([{"image_path": "a", "joints": [], "visibility": []}])"),
              HasSubstr("badja"));
  EXPECT_THAT(refusal("x.json", "[1, 2]"), HasSubstr("expected COCO"));
}

}  // namespace
}  // namespace q3d::loaders::formats
