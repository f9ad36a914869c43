// JSON files that a user may give to the wrong format.
#include "loaders/formats/other_tools.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace q3d::loaders::formats {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

const json kCoco = {{"images", json::array()}, {"annotations", json::array()}};
const json kPrima = {{"data", json::array()}};
const json kDogs = json::array({{{"img_path", "a.jpg"}, {"joints", json::array()}}});
const json kBadja =
    json::array({{{"image_path", "a.jpg"}, {"joints", json::array()}, {"visibility", json::array()}}});

TEST(OtherTools, a_form_that_another_format_reads_is_named_with_it) {
  EXPECT_THAT(known_tool(kPrima, "coco"), HasSubstr("which the format \"prima\" reads"));
  EXPECT_THAT(known_tool(kDogs, "prima"), HasSubstr("which the format \"stanfordextra\" reads"));
  EXPECT_THAT(known_tool(kBadja, "coco"), HasSubstr("which the format \"badja\" reads"));
  for (const char* format : {"prima", "stanfordextra", "badja"}) {
    EXPECT_THAT(known_tool(kCoco, format), HasSubstr("which the format \"coco\" reads")) << format;
  }
}

TEST(OtherTools, the_form_that_a_format_reads_is_not_refused) {
  for (const char* format : {"coco", "superanimal", "animal_kingdom", "photographs"}) {
    EXPECT_EQ(known_tool(kCoco, format), "") << format;
  }
  EXPECT_EQ(known_tool(kPrima, "prima"), "");
  EXPECT_EQ(known_tool(kDogs, "stanfordextra"), "");
  EXPECT_EQ(known_tool(kBadja, "badja"), "");
  EXPECT_EQ(known_tool(json::array(), "coco"), "");
  EXPECT_EQ(known_tool(json::array({1, 2}), "coco"), "");
  EXPECT_EQ(known_tool({{"a.jpg", 5}}, "coco"), "");
}

TEST(OtherTools, what_no_format_reads_is_told_with_a_way) {
  const json region = {{"filename", "a.jpg"}, {"size", 7}, {"regions", json::array()}};
  EXPECT_THAT(known_tool({{"a.jpg7", region}}, "coco"), HasSubstr("VGG Image Annotator"));
  EXPECT_THAT(known_tool(json::array({{{"image", "a.jpg"}, {"annotator", 1}}}), "coco"),
              HasSubstr("JSON-MIN"));
  const json record = {{"img_path", "a.jpg"}, {"keypoint_2d", json::array()}};
  EXPECT_THAT(known_tool(json::array({record}), "prima"), HasSubstr("under \"data\""));
  EXPECT_THROW(refuse_other_form(kCoco, "prima", "labels.json"), std::runtime_error);
}

}  // namespace
}  // namespace q3d::loaders::formats
