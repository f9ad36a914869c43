// Shards that were written once and are committed, one for each schema: every later version must read them,
// and read the same values.
//
// write_shard_main.cpp wrote tests/data/shards/schema_N.h5 when schema N was current. Do not write them anew:
// shards of that age are on other people's disks. The values below are what went into them; they are stated
// here and not taken from shard_fixture.h, which may change with the schema.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "manifests/digest.h"
#include "manifests/shard.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Element k of an array is first + k / 8, exact in float32.
template <typename Numbers>
void expect_ramp(const char* name, const Numbers& numbers, double first) {
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    EXPECT_EQ(numbers[k], first + static_cast<double>(k) / 8.0) << name << ", element " << k;
  }
}

// Row r of every array begins 100 r above row 0.
void expect_arrays(const ShardSample& sample, int row) {
  const double above = 100.0 * row;
  const Box& box = sample.record.box;
  expect_ramp("box_xywh_px", std::array{box.x_px, box.y_px, box.w_px, box.h_px}, 1 + above);
  std::array<double, 2 * kNumKeypoints> xy_px{};
  for (std::size_t k = 0; k < kNumKeypoints; ++k) {
    const Keypoint& keypoint = sample.record.keypoints[k];
    xy_px[2 * k] = keypoint.x_px;
    xy_px[2 * k + 1] = keypoint.y_px;
    EXPECT_EQ(keypoint.v, k % 2 == 0 ? -1.0F : 2.0F) << k;
    EXPECT_EQ(keypoint.weight, k % 2 == 0 ? 0.0F : 1.0F) << k;
  }
  expect_ramp("keypoints_px", xy_px, 2 + above);
  expect_ramp("crop_from_image", sample.crop_from_image, 3 + above);
  expect_ramp("patch_box_px", sample.patch_box, 4 + above);
  expect_ramp("pose", sample.body.pose, 5 + above);
  expect_ramp("betas", sample.body.betas, 6 + above);
  expect_ramp("camera", std::array{sample.body.camera.s, sample.body.camera.tx, sample.body.camera.ty},
              7 + above);
  expect_ramp("trans", sample.body.translation, 8 + above);
  expect_ramp("keypoints_3d", sample.keypoints_3d, 9 + above);
  std::array<float, 2 * kNumKeypoints> projected{};
  for (std::size_t k = 0; k < kNumKeypoints; ++k) {
    projected[2 * k] = sample.projected_2d[k].x;
    projected[2 * k + 1] = sample.projected_2d[k].y;
  }
  expect_ramp("projected_2d", projected, 10 + above);
}

struct Committed {
  int schema;
  const char* sha256;
};

class CommittedShard : public ::testing::TestWithParam<Committed> {
 protected:
  void SetUp() override { ASSERT_EQ(shard_.samples.size(), 3U); }

  const SampleRecord& record(std::size_t row) const { return shard_.samples[row].record; }

  std::filesystem::path path_ =
      testing::data_dir() / "shards" / ("schema_" + std::to_string(GetParam().schema) + ".h5");
  Shard shard_ = read_shard(path_);
};

TEST_P(CommittedShard, IsTheFileThatWasCommitted) {
  EXPECT_EQ(sha256_file(path_), GetParam().sha256);
}

TEST_P(CommittedShard, Header) {
  EXPECT_EQ(shard_.header.schema, GetParam().schema);
  EXPECT_EQ(shard_.header.dataset, "quadruped3d");
  EXPECT_EQ(shard_.header.version, "0123456789ab");
  EXPECT_EQ(shard_.header.unit, 42);
  EXPECT_EQ(shard_.header.image_encoding, ImageEncoding::png);
}

TEST_P(CommittedShard, Records) {
  const std::vector<std::string> ids{"world/train/img0.png#0", "world/train/img1.png#1",
                                     "world/train/img2.png#2"};
  const std::vector<std::string> image_refs{"img0.png", "img1.png", "img2.png"};
  const std::vector<std::string> sources{"", "sub", "sub"};
  const std::vector<std::string> species{"żubr", "red fox", "red fox"};
  const std::vector<Family> families{Family::none, Family::felidae, Family::canidae};
  const std::vector<int> heights{480, 481, 482};
  for (std::size_t row = 0; row < 3; ++row) {
    SCOPED_TRACE(row);
    EXPECT_EQ(record(row).id, ids[row]);
    EXPECT_EQ(record(row).dataset, "world");
    EXPECT_EQ(record(row).split, "train");
    EXPECT_EQ(record(row).source, sources[row]);
    EXPECT_EQ(record(row).species, species[row]);
    EXPECT_EQ(record(row).family, families[row]);
    EXPECT_EQ(record(row).image_ref, image_refs[row]);
    EXPECT_EQ(record(row).image_path, "");
    EXPECT_EQ(record(row).mask_path, "");
    EXPECT_EQ(record(row).width_px, 640);
    EXPECT_EQ(record(row).height_px, heights[row]);
    EXPECT_EQ(record(row).failure, Reason::none);
  }
}

TEST_P(CommittedShard, Pictures) {
  const std::vector<std::string> digests{std::string(64, 'a'), std::string(64, 'b'), std::string(64, 'c')};
  const std::vector<std::string> crops{{"crop\0", 5}, {"crop\xff\0", 6}, {"crop\xff\xff\0", 7}};
  const std::vector<std::string> masks{"", "mask", ""};
  const std::vector<int> heights{481, 482, 483};
  for (std::size_t row = 0; row < 3; ++row) {
    SCOPED_TRACE(row);
    const ShardSample& sample = shard_.samples[row];
    EXPECT_EQ(sample.image_sha256, digests[row]);
    EXPECT_EQ(sample.image_width_px, 641);
    EXPECT_EQ(sample.image_height_px, heights[row]);
    EXPECT_EQ(text_of(sample.crop), crops[row]);
    EXPECT_EQ(text_of(sample.crop_mask), masks[row]);
    EXPECT_EQ(sample.crop_side_px, 480);
  }
}

TEST_P(CommittedShard, Labels) {
  const std::vector<bool> has_keypoints_3d{false, true, false};
  for (std::size_t row = 0; row < 3; ++row) {
    SCOPED_TRACE(row);
    const ShardSample& sample = shard_.samples[row];
    EXPECT_EQ(sample.label_kind, row == 0 ? LabelKind::retained : LabelKind::refined);
    EXPECT_TRUE(sample.has_pose);
    EXPECT_FALSE(sample.has_betas);
    EXPECT_EQ(sample.has_keypoints_3d, has_keypoints_3d[row]);
    expect_arrays(sample, static_cast<int>(row));
  }
}

TEST_P(CommittedShard, Judgements) {
  const std::vector<double> initial_errors{0.25, 1.25, 2.25};
  const std::vector<double> final_errors{0.125, 1.125, 2.125};
  const std::vector<int> iterations{0, 10, 20};
  const std::vector<int> best_iterations{0, 7, 14};
  for (std::size_t row = 0; row < 3; ++row) {
    SCOPED_TRACE(row);
    const Judgement& judgement = shard_.samples[row].judgement;
    EXPECT_EQ(judgement.verdict, row == 0 ? Verdict::retained : Verdict::refined);
    EXPECT_EQ(judgement.reason, Reason::none);
    EXPECT_EQ(judgement.detail, "");
    EXPECT_EQ(judgement.initial_error, initial_errors[row]);
    EXPECT_EQ(judgement.final_error, final_errors[row]);
    EXPECT_EQ(judgement.iterations, iterations[row]);
    EXPECT_EQ(judgement.best_iteration, best_iterations[row]);
  }
  EXPECT_TRUE(std::isnan(shard_.samples[0].judgement.gain));
  EXPECT_EQ(shard_.samples[1].judgement.gain, 0.5);
  EXPECT_EQ(shard_.samples[2].judgement.gain, 0.5);
}

// Schema 2 added them.
TEST_P(CommittedShard, TrustScores) {
  for (std::size_t row = 0; row < 3; ++row) {
    const bool is_measured = GetParam().schema >= 2 && row > 0;
    double expected = 15.0 + 100.0 * static_cast<double>(row);  // 1 / 8 more in each column
    for (const TrustColumn& column : kTrustColumns) {
      SCOPED_TRACE(column.name);
      const double score = shard_.samples[row].judgement.trust.*column.score;
      if (is_measured) {
        EXPECT_EQ(score, expected);
      } else {
        EXPECT_TRUE(std::isnan(score));
      }
      expected += 0.125;
    }
  }
}

TEST_P(CommittedShard, TermsOfTheDatasets) {
  const auto& datasets = shard_.header.datasets;
  if (GetParam().schema == 1) {
    EXPECT_TRUE(datasets.empty());
    return;
  }
  ASSERT_EQ(datasets.size(), 2U);
  const auto& world = datasets.at("world/train");
  EXPECT_EQ(world.licence, "CC0-1.0");
  EXPECT_EQ(world.source_url, "https://example.org/world");
  EXPECT_EQ(world.citation, "The \"world\" of 2026");
  EXPECT_EQ(datasets.at("wild/test").licence, "");
}

TEST_P(CommittedShard, Truth) {
  EXPECT_FALSE(record(0).truth.has_value());
  EXPECT_FALSE(record(2).truth.has_value());
  ASSERT_TRUE(record(1).truth.has_value());
  const BodyTruth& truth = *record(1).truth;
  EXPECT_FALSE(truth.has_pose);
  EXPECT_TRUE(truth.has_betas);
  EXPECT_FALSE(truth.has_keypoints_3d);
  expect_ramp("truth_pose", truth.pose_axis_angle, 111);
  expect_ramp("truth_betas", truth.betas, 112);
  expect_ramp("truth_trans", truth.trans, 113);
  expect_ramp("truth_keypoints_3d", truth.keypoints_3d, 114);
}

INSTANTIATE_TEST_SUITE_P(
    Schemas, CommittedShard,
    ::testing::Values(Committed{1, "d5faed931ce65068de6a95dea5743b91a487f665bedb7d76f562b23ec8baa915"},
                      Committed{2, "c70a0f00d7e6369389d19df721354a35e1fe0b4a9ffa711e77d0a82771c38ea2"}),
    [](const auto& tried) { return "schema_" + std::to_string(tried.param.schema); });

}  // namespace
}  // namespace q3d::manifests
