#include "pipeline/candidates/label_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace q3d::pipeline::candidates {
namespace {

using manifests::Reason;
using manifests::SampleRecord;
using ::testing::HasSubstr;

// Ten keypoints on the diagonal from (10, 10) to (100, 100), in a picture of 200 x 150 px.
SampleRecord record() {
  SampleRecord made;
  made.box = {5.0, 5.0, 100.0, 100.0};
  for (std::size_t i = 0; i < 10; ++i) made.keypoints[i] = {10.0 + 10.0 * i, 10.0 + 10.0 * i, 2.0F, 1.0F};
  return made;
}

Reason reason_of(const SampleRecord& record) {
  const auto problem = find_label_problem(record, 200, 150);
  return problem ? problem->reason : Reason::none;
}

TEST(LabelChecks, good_labels_pass) {
  EXPECT_EQ(reason_of(record()), Reason::none);
}

TEST(LabelChecks, half_of_the_points_may_lie_outside) {
  SampleRecord moved = record();
  for (std::size_t i = 0; i < 5; ++i) moved.keypoints[i].x_px = -50.0;
  moved.box = {-60.0, 0.0, 200.0, 120.0};
  EXPECT_EQ(reason_of(moved), Reason::none);
  EXPECT_EQ(keypoints_outside(moved, 200, 150), 5);
  moved.keypoints[5].y_px = 153.0;
  EXPECT_EQ(reason_of(moved), Reason::keypoints_outside);
  moved.keypoints[5].y_px = 151.5;  // within two pixels of the border
  EXPECT_EQ(reason_of(moved), Reason::none);
  moved.keypoints[6] = {-50.0, 10.0, 0.0F, 0.0F};  // not labelled, and five of nine are outside
  EXPECT_EQ(reason_of(moved), Reason::keypoints_outside);
}

TEST(LabelChecks, points_beside_their_box) {
  SampleRecord moved = record();
  moved.box = {45.0, 45.0, 60.0, 60.0};  // 8 px around it are its own: four points lie further out
  EXPECT_EQ(reason_of(moved), Reason::none);
  moved.box = {120.0, 20.0, 60.0, 60.0};
  EXPECT_EQ(reason_of(moved), Reason::keypoints_outside);
  EXPECT_THAT(find_label_problem(moved, 200, 150)->detail, HasSubstr("outside the box x 120, y 20"));
}

TEST(LabelChecks, fractions_are_no_pixels) {
  SampleRecord fractions = record();
  for (auto& point : fractions.keypoints) {
    point.x_px /= 200.0;
    point.y_px /= 150.0;
  }
  EXPECT_EQ(reason_of(fractions), Reason::not_in_pixels);
  EXPECT_THAT(find_label_problem(fractions, 200, 150)->detail, HasSubstr("between 0 and 1"));
  fractions = record();
  fractions.box = {0.05, 0.05, 0.5, 0.6};
  EXPECT_EQ(reason_of(fractions), Reason::not_in_pixels);
  SampleRecord one = record();  // a single point in the corner says nothing
  for (std::size_t i = 1; i < 10; ++i) one.keypoints[i].weight = 0.0F;
  one.keypoints[0] = {0.5, 0.5, 2.0F, 1.0F};
  one.box = {-10.0, -10.0, 20.0, 20.0};
  EXPECT_EQ(reason_of(one), Reason::none);
}

TEST(LabelChecks, boxes_of_a_few_pixels) {
  SampleRecord small = record();
  small.box = {50.0, 50.0, 4.0, 3.0};
  EXPECT_EQ(reason_of(small), Reason::box_too_small);
  small.box = {0.0, 50.0, 110.0, 4.0};  // flat, and the points are not in it
  EXPECT_EQ(reason_of(small), Reason::keypoints_outside);
}

TEST(LabelChecks, normalised_points_may_lie_a_little_beside_0_to_1) {
  SampleRecord normalised = record();
  for (std::size_t i = 0; i < 10; ++i) normalised.keypoints[i] = {-0.2 + 0.15 * i, 0.1 * i, 2.0F, 1.0F};
  normalised.box = {0.0, 0.0, 150.0, 100.0};
  EXPECT_EQ(reason_of(normalised), Reason::not_in_pixels);
}

TEST(LabelChecks, points_that_nobody_moved_from_one_place_fail) {
  SampleRecord heap = record();
  for (std::size_t i = 0; i < 10; ++i) heap.keypoints[i] = {50.0, 40.0 + 0.1 * i, 2.0F, 1.0F};
  EXPECT_EQ(reason_of(heap), Reason::keypoints_outside);
  heap.keypoints[9].x_px = 60.0;
  EXPECT_EQ(reason_of(heap), Reason::none);
  for (std::size_t i = 2; i < 10; ++i) heap.keypoints[i].weight = 0.0F;
  EXPECT_EQ(reason_of(heap), Reason::none) << "two points alone may lie close together";
}

}  // namespace
}  // namespace q3d::pipeline::candidates
