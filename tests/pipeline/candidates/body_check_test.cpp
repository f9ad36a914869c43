#include "pipeline/candidates/body_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "pipeline/animal/synthetic_files.h"
#include "pipeline/device/network.h"
#include "pipeline/network/torch_bodies.h"
#include "smal/axis_angle.h"

namespace q3d::pipeline::candidates {
namespace {

namespace fs = std::filesystem;
using manifests::SampleRecord;
using testing::HasSubstr;

class BodyCheckTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = fs::temp_directory_path() / ("q3d_body_check_" + std::to_string(getpid()));
    fs::create_directories(folder);
    animal::write_synthetic_asset(folder / "smal.safetensors");
    bodies = network::load_body_meshes(folder / "smal.safetensors").release();
  }
  static void TearDownTestSuite() {
    delete bodies;
    fs::remove_all(folder);
  }

  // A bent, long body turned about y, whose file puts the origin 3 units away.
  static SampleRecord consistent(const std::string& id) {
    SampleRecord record;
    record.id = id;
    auto& truth = record.truth.emplace();
    truth.has_pose = truth.has_betas = truth.has_keypoints_3d = true;
    truth.pose_axis_angle[1] = 0.8F;
    truth.pose_axis_angle[3 * 7 + 2] = 0.4F;
    truth.betas[0] = 1.2F;
    const smal::Body body{.pose = smal::rotation_matrices(truth.pose_axis_angle), .betas = truth.betas};
    truth.keypoints_3d = bodies->pose(std::span(&body, 1)).front().keypoints_3d;
    for (std::size_t i = 2; i < truth.keypoints_3d.size(); i += 3) truth.keypoints_3d[i] += 3.0F;
    return record;
  }

  static inline fs::path folder;
  static inline device::BodyMeshes* bodies = nullptr;
};

TEST(RecordsOfOneCall, EndAtTheLastMeshOrAtABound) {
  SampleRecord with_body;
  manifests::BodyTruth& truth = with_body.truth.emplace();
  truth.has_pose = truth.has_betas = true;
  std::vector<SampleRecord> records(10);
  records.resize(10 + 255, with_body);
  EXPECT_EQ(records_of_one_call(records), 0U);
  records.resize(10 + 300, with_body);
  EXPECT_EQ(records_of_one_call(records), 10U + 256U);
  std::vector<SampleRecord> without(kMostRecordsOfOneCall - 1);
  EXPECT_EQ(records_of_one_call(without), 0U);
  without.resize(kMostRecordsOfOneCall + 5);
  EXPECT_EQ(records_of_one_call(without), kMostRecordsOfOneCall) << "records without bodies do not pile up";
}

TEST_F(BodyCheckTest, AgreesWithAFileOfTheSameBodyWhereverItsOriginLies) {
  std::vector<SampleRecord> records{consistent("a")};
  const BodyCheck check = check_bodies(*bodies, false, records);
  EXPECT_EQ(check.compared, 1U);
  EXPECT_EQ(check.apart, 0U);
  EXPECT_LT(check.largest_mm, 0.01);
  EXPECT_EQ(check.findings, std::vector<std::string>{""});
}

TEST_F(BodyCheckTest, NamesTheKeypointThatIsOffAndLeavesIt) {
  std::vector<SampleRecord> records{consistent("a"), consistent("b")};
  records[1].truth->keypoints_3d[3 * 20] += 0.026F;  // its own share in the centroid is a 26th
  const BodyCheck check = check_bodies(*bodies, false, records);
  EXPECT_EQ(check.apart, 1U);
  EXPECT_EQ(check.largest_id, "b");
  EXPECT_NEAR(check.largest_mm, 25.0, 0.01);
  EXPECT_EQ(check.findings[0], "");
  EXPECT_THAT(check.findings[1], HasSubstr("keypoint 20 lies 25.0 mm"));
  EXPECT_NEAR(records[1].truth->keypoints_3d[3 * 20] - records[0].truth->keypoints_3d[3 * 20], 0.026, 1e-6);
  EXPECT_THAT(to_note(check), HasSubstr("1 of 2 agree within 1 mm; the largest difference is 25.0 mm, b"));
}

TEST_F(BodyCheckTest, ABodyFromAnotherPoseIsFoundAndCanBeTaken) {
  std::vector<SampleRecord> records{consistent("a")};
  const auto body = records[0].truth->keypoints_3d;
  records[0].truth->pose_axis_angle[1] += 0.3F;  // the file's keypoints are of the old pose
  const BodyCheck check = check_bodies(*bodies, true, records);
  EXPECT_EQ(check.apart, 1U);
  EXPECT_GT(check.largest_mm, 50.0);
  EXPECT_THAT(check.findings[0], HasSubstr("which was taken"));
  EXPECT_NE(records[0].truth->keypoints_3d, body);
  std::vector<SampleRecord> again = records;
  EXPECT_EQ(check_bodies(*bodies, false, again).apart, 0U);
}

TEST_F(BodyCheckTest, FillsWhatIsMissingAndSkipsWhatCannotBeCompared) {
  std::vector<SampleRecord> records(4, consistent("a"));
  const auto body = records[0].truth->keypoints_3d;
  records[0].truth->has_keypoints_3d = false;
  records[0].truth->keypoints_3d = {};
  records[1].truth->has_betas = false;
  records[2].truth.reset();
  records[3].failure = manifests::Reason::box_missing;
  const BodyCheck check = check_bodies(*bodies, false, records);
  EXPECT_EQ(check.compared, 0U);
  EXPECT_EQ(check.filled, 1U);
  EXPECT_TRUE(records[0].truth->has_keypoints_3d);
  EXPECT_NEAR(records[0].truth->keypoints_3d[2], body[2] - 3.0F, 1e-5);
  EXPECT_THAT(check.findings[0], HasSubstr("computed from its body"));
  for (const std::size_t i : {1, 2, 3}) EXPECT_EQ(check.findings[i], "");
}

}  // namespace
}  // namespace q3d::pipeline::candidates
