// Records in PRIMA's form that hold several animals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Reason;
using manifests::SampleRecord;
using ::testing::HasSubstr;

// The record of one animal, twice in one: the second animal's points lie 5 px to the right.
json pair() {
  json record = prima_record();
  json shifted = keypoint_rows(26);
  for (json& row : shifted) row[0] = row[0].get<double>() + 5.0;
  record["bbox"] = {{8, 8, 36, 26}, {13, 8, 36, 26}};
  record["keypoint_2d"] = json::array({keypoint_rows(26), shifted});
  record["keypoint_3d"] = json::array({keypoint_rows(26), keypoint_rows(26)});
  for (const char* field : {"pose", "shape", "shape_extra", "trans"}) {
    record[field] = json::array({prima_record()[field], prima_record()[field]});
  }
  record["supercategory"] = {2, 1};
  return record;
}

TEST(SeveralAnimals, become_a_record_each) {
  const Folder folder;
  const Dataset dataset = folder.load_prima({prima_record(), pair(), prima_record()});
  ASSERT_EQ(dataset.records.size(), 4U);
  for (const SampleRecord& record : dataset.records) {
    EXPECT_EQ(record.failure, Reason::none) << record.failure_detail;
    EXPECT_TRUE(record.truth && record.truth->has_pose);
  }
  EXPECT_EQ(dataset.records[1].id, "set/train/images/train/horse/000000000001_horse.png#1.0");
  EXPECT_EQ(dataset.records[2].id, "set/train/images/train/horse/000000000001_horse.png#1.1");
  EXPECT_EQ(dataset.records[3].id, "set/train/images/train/horse/000000000001_horse.png#2");
  EXPECT_EQ(dataset.records[2].box.x_px, 13.0);
  EXPECT_EQ(dataset.records[2].keypoints[0].x_px, dataset.records[1].keypoints[0].x_px + 5.0);
  EXPECT_EQ(dataset.records[1].family, manifests::Family::equidae);
  EXPECT_EQ(dataset.records[2].family, manifests::Family::canidae);
  EXPECT_EQ(dataset.records[1].mask_path, "") << "one mask of two animals is neither's silhouette";
  EXPECT_THAT(joined(dataset.notes), HasSubstr("each of which becomes a sample: 1"));
}

TEST(SeveralAnimals, one_animal_in_lists_of_one) {
  const Folder folder;
  json record = prima_record();
  for (const char* field : {"bbox", "keypoint_2d", "keypoint_3d", "pose", "shape", "shape_extra", "trans"}) {
    record[field] = json::array({prima_record()[field]});
  }
  const Dataset dataset = folder.load_prima({record});
  ASSERT_EQ(dataset.records.size(), 1U);
  EXPECT_EQ(dataset.records[0].failure, Reason::none) << dataset.records[0].failure_detail;
  EXPECT_NE(dataset.records[0].mask_path, "");
}

TEST(SeveralAnimals, fail_where_a_field_does_not_say_whose_it_is) {
  const Folder folder;
  for (const char* field : {"keypoint_2d", "pose", "trans"}) {
    json record = pair();
    record[field] = prima_record()[field];
    const Dataset dataset = folder.load_prima({record, prima_record()});
    ASSERT_EQ(dataset.records.size(), 2U);
    EXPECT_EQ(dataset.records[0].failure, Reason::record_malformed) << field;
    EXPECT_THAT(dataset.records[0].failure_detail,
                HasSubstr("got boxes of 2 animals, expected one record an animal"));
    EXPECT_EQ(dataset.records[1].failure, Reason::none);
  }
}

}  // namespace
}  // namespace q3d::loaders::formats
