// Sources' own files, in the forms that AP-10K, AnimalPose and video sets have.
#include "loaders/curation/source_labels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/paths.h"

namespace q3d::loaders::curation {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class SourceLabelsTest : public ::testing::Test {
 protected:
  void add(const json& document) { add_text(document.dump()); }
  void add_text(const std::string& text) {
    const auto file = scratch_.path() / ("source" + std::to_string(files_++) + ".json");
    std::ofstream(file) << text;
    labels_.add(file);
  }
  std::string refusal(const json& document) {
    try {
      add(document);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "accepted";
  }

  q3d::testing::ScratchDir scratch_;
  SourceLabels labels_;
  int files_ = 0;
};

json ap10k() {
  return {{"images",
           {{{"id", 4}, {"file_name", "000000000004.jpg"}},
            {{"id", 5}, {"file_name", "000000000005.jpg"}},
            {{"id", 6}, {"file_name", "000000000006.jpg"}}}},
          {"categories", {{{"id", 1}, {"name", "Polar Bear"}}, {{"id", 2}, {"name", "deer"}}}},
          {"annotations",
           {{{"id", 1}, {"image_id", 4}, {"category_id", 1}},
            {{"id", 2}, {"image_id", 4}, {"category_id", 1}},
            {{"id", 3}, {"image_id", 5}, {"category_id", 1}},
            {{"id", 4}, {"image_id", 5}, {"category_id", 2}}}}};
}

TEST_F(SourceLabelsTest, species_come_by_stem_with_and_without_superanimals_number) {
  add(ap10k());
  for (const char* name :
       {"000000000004.jpg", "images/000000000004_1234.jpg", "/disk/x/000000000004_7.png"}) {
    ASSERT_TRUE(labels_.find(name)) << name;
    EXPECT_EQ(labels_.find(name)->species, "polar bear") << name;
    EXPECT_EQ(labels_.find(name)->clip, "") << name;
  }
  EXPECT_EQ(labels_.find("000000000005_1.jpg")->species, "") << "of two species";
  EXPECT_EQ(labels_.find("000000000006_1.jpg")->species, "") << "without an annotation";
  EXPECT_FALSE(labels_.find("000000000007_1.jpg"));
  add(ap10k());  // splits overlap: what agrees stays
  EXPECT_EQ(labels_.find("000000000004_1.jpg")->species, "polar bear");
}

TEST_F(SourceLabelsTest, images_may_be_an_object_as_animalpose_has_it) {
  add({{"images", {{"1", "2010_001705.jpeg"}, {"2", "ca110.jpeg"}}},
       {"categories", {{{"id", 1}, {"name", "dog"}}, {{"id", 3}, {"name", "cow"}}}},
       {"annotations", {{{"image_id", 1}, {"category_id", 1}}, {{"image_id", 2}, {"category_id", 3}}}}});
  EXPECT_EQ(labels_.find("2010_001705_77.jpeg")->species, "dog");
  EXPECT_EQ(labels_.find("ca110_9.jpeg")->species, "cow");
}

TEST_F(SourceLabelsTest, videos_come_from_their_id_or_else_from_folders) {
  json document = ap10k();
  document["images"] = {{{"id", 4}, {"file_name", "deer/clip1/f1.jpg"}},
                        {{"id", 5}, {"file_name", "deer/clip2/f2.jpg"}},
                        {{"id", 6}, {"file_name", "deer/clip2/f3.jpg"}, {"video_id", 77}},
                        {{"id", 7}, {"file_name", "deer/clip3/f2.jpg"}}};
  document["annotations"] = {{{"image_id", 5}, {"category_id", 2}}, {{"image_id", 7}, {"category_id", 2}}};
  add(document);
  EXPECT_EQ(labels_.find("f1_900.jpg")->clip, "deer/clip1/");
  EXPECT_EQ(labels_.find("f3_901.jpg")->clip, "video 77");
  EXPECT_EQ(labels_.find("f2_902.jpg"), (SourceLabel{"deer", ""})) << "two pictures of that stem";
}

TEST_F(SourceLabelsTest, what_is_no_such_file_is_refused_by_place) {
  json document = ap10k();
  document["images"][1].erase("file_name");
  EXPECT_THAT(refusal(document), HasSubstr("images[1]: file_name: got"));
  document = ap10k();
  document["images"][0]["id"] = nullptr;
  EXPECT_THAT(refusal(document), HasSubstr("images[0]: id: got"));
  document = ap10k();
  document["categories"][1]["name"] = 3;
  EXPECT_THAT(refusal(document), HasSubstr("categories[1]: name: got"));
  document = ap10k();
  document["annotations"][2]["category_id"] = 0.5;
  EXPECT_THAT(refusal(document), HasSubstr("annotations[2]: category_id: got"));
  document = ap10k();
  document.erase("categories");
  EXPECT_THAT(refusal(document), HasSubstr("categories"));
  EXPECT_THAT(refusal(json::array()), HasSubstr("source"));
  document = ap10k();
  document["images"] = {{"1", 5}};
  EXPECT_THAT(refusal(document), HasSubstr("images: 1: got"));
}

}  // namespace
}  // namespace q3d::loaders::curation
