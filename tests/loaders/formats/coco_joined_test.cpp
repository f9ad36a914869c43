// COCO files that were joined from several, or written by a tool that knows COCO by hearsay.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Reason;
using ::testing::HasSubstr;

// SuperAnimal's file with two pictures and an annotation each.
Dataset load(const json& document) {
  const Folder folder;
  return folder.load("superanimal", document);
}

TEST(CocoJoined, annotations_of_an_id_that_two_pictures_share_fail) {
  json document = superanimal_document(3);
  document["images"][1]["id"] = document["annotations"][1]["image_id"] = 100;
  const Dataset dataset = load(document);
  EXPECT_EQ(dataset.records[0].failure, Reason::record_malformed);
  EXPECT_EQ(dataset.records[1].failure, Reason::record_malformed);
  EXPECT_THAT(dataset.records[1].failure_detail,
              HasSubstr("100, which the images horse_11361_0.png and horse_11361_1.png share"));
  EXPECT_EQ(dataset.records[2].failure, Reason::none);
  EXPECT_THAT(joined(dataset.notes), HasSubstr("ids that several pictures share"));
}

TEST(CocoJoined, a_picture_that_is_listed_twice_is_no_doubt) {
  json document = superanimal_document(2);
  document["images"].push_back(document["images"][0]);
  const Dataset dataset = load(document);
  EXPECT_EQ(dataset.records[0].failure, Reason::none);
  EXPECT_THAT(joined(dataset.notes),
              HasSubstr("images that repeat the id of an earlier image of the same name: 1"));
}

TEST(CocoJoined, two_categories_of_one_id_are_refused_unless_they_are_the_same) {
  json document = superanimal_document(1);
  document["categories"].push_back(document["categories"][0]);
  EXPECT_EQ(load(document).records[0].failure, Reason::none);
  document["categories"][1]["name"] = "cat";
  try {
    load(document);
    FAIL() << "nothing thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("got the id 1 for both \"superquadruped\" and \"cat\""));
  }
}

TEST(CocoJoined, a_v_above_2_is_told) {
  json document = superanimal_document(1);
  EXPECT_THAT(joined(load(document).notes), ::testing::Not(HasSubstr("v is above 2")));
  document["annotations"][0]["keypoints"][2] = 87;
  EXPECT_THAT(joined(load(document).notes), HasSubstr("keypoints whose v is above 2 (such as 87)"));
}

}  // namespace
}  // namespace q3d::loaders::formats
