#include "pipeline/feed/feed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "tests/pipeline/feed/sample_shards.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::feed {
namespace {

constexpr std::size_t kImageNumbers = std::size_t{3} * 256 * 256;

class FeedTest : public ::testing::Test {
 protected:
  FeedTest() {
    std::filesystem::create_directories(scratch_.path() / "set/shards");
    testing::write_sample_shard(scratch_.path() / "set/shards/000000.h5", "a", 3, 10);
    testing::write_sample_shard(scratch_.path() / "set/shards/000001.h5", "b", 4, 20);
    testing::write_sample_shard(scratch_.path() / "single.h5", "c", 1, 30);
  }

  Feed feed(const FeedOptions& options, std::uint64_t seed = 1) const {
    std::vector<ShardPool> pools;
    pools.emplace_back("set", std::vector<std::filesystem::path>{scratch_.path() / "set"});
    return {std::move(pools), {1.0}, options, seed};
  }

  // One labelled sample, over and over.
  Feed single(const FeedOptions& options) const {
    std::vector<ShardPool> pools;
    pools.emplace_back("single", std::vector<std::filesystem::path>{scratch_.path() / "single.h5"});
    return {std::move(pools), {1.0}, options, 1};
  }

  static void expect_equal(const FeedBatch& a, const FeedBatch& b) {
    ASSERT_EQ(a.size, b.size);
    EXPECT_TRUE(std::equal(a.images.get(), a.images.get() + a.size * kImageNumbers, b.images.get()));
    EXPECT_EQ(a.keypoints_2d, b.keypoints_2d);
    EXPECT_EQ(a.keypoints_3d, b.keypoints_3d);
    EXPECT_EQ(a.rotations, b.rotations);
    EXPECT_EQ(a.betas, b.betas);
    EXPECT_EQ(a.has_pose, b.has_pose);
    EXPECT_EQ(a.has_betas, b.has_betas);
    EXPECT_EQ(a.family, b.family);
  }

  testing::ScratchDir scratch_;
};

TEST_F(FeedTest, PoolNumbersTheSamplesOfAllShards) {
  const ShardPool pool("set", {scratch_.path() / "set", scratch_.path() / "single.h5"});
  ASSERT_EQ(pool.size(), 8);
  EXPECT_EQ(pool.id(0), "a/0");
  EXPECT_EQ(pool.id(2), "a/2");
  EXPECT_EQ(pool.id(3), "b/0");
  EXPECT_EQ(pool.id(7), "c/0");
  EXPECT_THROW(pool.id(8), std::out_of_range);
  EXPECT_THROW(pool.sample(-1), std::out_of_range);
}

TEST_F(FeedTest, ShardsThatCannotTrainAreNamed) {
  std::filesystem::create_directories(scratch_.path() / "nothing");
  EXPECT_THROW(ShardPool("x", {scratch_.path() / "nothing"}), std::runtime_error);
  EXPECT_THROW(ShardPool("x", {scratch_.path() / "absent"}), std::runtime_error);
  manifests::ShardSample bare = testing::shard_sample("r", 1, true);
  bare.crop.clear();
  bare.crop_side_px = 0;
  manifests::ShardHeader header;
  header.image_encoding = manifests::ImageEncoding::reference;
  manifests::write_shard(scratch_.path() / "reference.h5", header, {bare});
  try {
    ShardPool("x", {scratch_.path() / "reference.h5"});
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("reference.h5: a shard without pictures"), std::string::npos);
  }
}

TEST_F(FeedTest, BytesDoNotDependOnThreadsNorOnWhatWasReadAhead) {
  const FeedBatch alone = feed({.batch = 6, .threads = 1}).batch(12);
  expect_equal(feed({.batch = 6, .threads = 4}).batch(12), alone);
  const Feed source = feed({.batch = 6, .threads = 2});
  FeedStream stream(source, 0, 3);
  stream.next();
  stream.next();
  const FeedBatch third = stream.next();
  EXPECT_EQ(third.first_draw, 12);
  expect_equal(third, alone);
  FeedStream resumed(source, 12, 0);
  expect_equal(resumed.next(), alone);
}

TEST_F(FeedTest, RanksShareEveryBatch) {
  const FeedBatch whole = feed({.batch = 6}).batch(12);
  for (const int rank : {0, 1, 2}) {
    const Feed source = feed({.batch = 6, .rank = rank, .ranks = 3});
    const FeedBatch part = source.batch(12);
    ASSERT_EQ(part.size, 2);
    EXPECT_EQ(part.first_draw, 12);
    EXPECT_TRUE(std::equal(part.images.get(), part.images.get() + 2 * kImageNumbers,
                           whole.images.get() + static_cast<std::size_t>(2 * rank) * kImageNumbers));
    EXPECT_TRUE(std::equal(part.keypoints_2d.begin(), part.keypoints_2d.end(),
                           whole.keypoints_2d.begin() + rank * 156));
    EXPECT_TRUE(std::equal(part.has_pose.begin(), part.has_pose.end(), whole.has_pose.begin() + rank * 2));
    // Messages name the whole batch, and the next one follows it.
    EXPECT_EQ(source.ids(12), feed({.batch = 6}).ids(12));
    EXPECT_EQ(source.batch_size(), 6);
  }
  EXPECT_THROW(feed({.batch = 7, .ranks = 3}), std::invalid_argument);
  EXPECT_THROW(feed({.batch = 6, .rank = 3, .ranks = 3}), std::invalid_argument);
}

TEST_F(FeedTest, AnotherSeedDrawsOtherBatches) {
  const FeedBatch a = feed({.batch = 6}, 1).batch(0), b = feed({.batch = 6}, 2).batch(0);
  EXPECT_NE(a.keypoints_2d, b.keypoints_2d);
}

TEST_F(FeedTest, WithoutAugmentationItIsThePlainCrop) {
  const manifests::ShardSample sample = testing::shard_sample("c/0", 30, true);
  const FeedBatch batch = single({.batch = 1, .augment = false}).batch(0);
  // Crop units: (keypoint - centre) / side, up to the rounding of pixels to float32.
  for (std::size_t i = 0; i < manifests::kNumKeypoints; ++i) {
    const manifests::Keypoint& keypoint = sample.record.keypoints[i];
    EXPECT_NEAR(batch.keypoints_2d[3 * i], (keypoint.x_px - sample.patch_box[0]) / sample.patch_box[2], 1e-6);
    EXPECT_NEAR(batch.keypoints_2d[3 * i + 1], (keypoint.y_px - sample.patch_box[1]) / sample.patch_box[2],
                1e-6);
    EXPECT_EQ(batch.keypoints_2d[3 * i + 2], 1.0F);
    EXPECT_EQ(batch.keypoints_3d[4 * i], sample.keypoints_3d[3 * i]);
    EXPECT_EQ(batch.keypoints_3d[4 * i + 3], 1.0F);
  }
  EXPECT_TRUE(std::equal(sample.body.pose.begin(), sample.body.pose.end(), batch.rotations.begin()));
  EXPECT_TRUE(std::equal(sample.body.betas.begin(), sample.body.betas.end(), batch.betas.begin()));
  EXPECT_EQ(batch.has_pose[0], 1.0F);
  EXPECT_EQ(batch.family[0], 0);
  // The picture's red channel is 255 x / 320, and the crop is not enlarged: at patch pixel (128, 128) the
  // image pixel is the box's centre.
  const double red = std::floor(sample.patch_box[0] * 255.0 / 320.0);
  const double normalised = (red - 255.0 * 0.485) / (255.0 * 0.229);
  EXPECT_NEAR(batch.images[128 * 256 + 128], normalised, 2.0 / (255.0 * 0.229));
}

TEST_F(FeedTest, RawVisibilityIsTheWeightWhenAsked) {
  const FeedBatch batch = single({.batch = 1, .keypoint_weight = KeypointWeight::raw_v}).batch(0);
  EXPECT_EQ(batch.keypoints_2d[2], 2.0F);
}

TEST_F(FeedTest, TheBodyTurnsWithThePicture) {
  loaders::pictures::AugmentOptions turns;
  turns.scale = turns.shift = turns.colour = 0.0;
  turns.rotation_rate = 1.0;
  const manifests::ShardSample sample = testing::shard_sample("c/0", 30, true);
  const FeedBatch batch = single({.batch = 8, .augmentation = turns}).batch(0);
  double largest = 0.0;
  for (std::size_t slot = 0; slot < 8; ++slot) {
    // The angle that the 2D keypoints turned by about the centre of the crop.
    const auto angle_of = [](double x, double y) { return std::atan2(y, x); };
    const float* points = batch.keypoints_2d.data() + slot * 78;
    const manifests::Keypoint& keypoint = sample.record.keypoints[0];
    const double before = angle_of(keypoint.x_px - sample.patch_box[0], keypoint.y_px - sample.patch_box[1]);
    const double turned = std::remainder(angle_of(points[0], points[1]) - before, 2.0 * M_PI);
    largest = std::max(largest, std::abs(turned));
    const float* body = batch.keypoints_3d.data() + slot * 104;
    const double body_before = angle_of(sample.keypoints_3d[0], sample.keypoints_3d[1]);
    EXPECT_NEAR(std::remainder(angle_of(body[0], body[1]) - body_before - turned, 2.0 * M_PI), 0.0, 1e-4);
    // Joint 0 is a turn about the same axis; its first column holds cosine and sine.
    const float* orient = batch.rotations.data() + slot * 315;
    const double orient_before = angle_of(sample.body.pose[0], sample.body.pose[3]);
    EXPECT_NEAR(std::remainder(angle_of(orient[0], orient[3]) - orient_before - turned, 2.0 * M_PI), 0.0,
                1e-4);
    EXPECT_EQ(orient[9], sample.body.pose[9]);  // other joints stay
  }
  EXPECT_GT(largest, 0.2);
}

TEST_F(FeedTest, SamplesWithoutABodyCarryNoLabel) {
  const Feed source = feed({.batch = 32, .augment = false});
  const FeedBatch batch = source.batch(0);
  const auto ids = source.ids(0);
  int without = 0;
  for (std::size_t slot = 0; slot < 32; ++slot) {
    const bool labelled = (ids[slot].back() - '0') % 2 == 0;
    EXPECT_EQ(batch.has_pose[slot], labelled ? 1.0F : 0.0F);
    EXPECT_EQ(batch.has_betas[slot], labelled ? 1.0F : 0.0F);
    EXPECT_EQ(batch.keypoints_3d[slot * 104 + 3], labelled ? 1.0F : 0.0F);
    if (!labelled) {
      ++without;
      EXPECT_EQ(batch.rotations[slot * 315], 1.0F);
      EXPECT_EQ(batch.rotations[slot * 315 + 1], 0.0F);
    }
  }
  EXPECT_GT(without, 4);
}

TEST_F(FeedTest, ADamagedPictureNamesItsSample) {
  manifests::ShardSample broken = testing::shard_sample("broken/7", 3, true);
  broken.crop.resize(broken.crop.size() / 3);
  std::fill(broken.crop.begin(), broken.crop.begin() + 8, std::byte{0});
  manifests::ShardHeader header;
  header.image_encoding = manifests::ImageEncoding::png;
  manifests::write_shard(scratch_.path() / "broken.h5", header, {broken});
  std::vector<ShardPool> pools;
  pools.emplace_back("bad", std::vector<std::filesystem::path>{scratch_.path() / "broken.h5"});
  const Feed source(std::move(pools), {1.0}, {.batch = 2}, 1);
  try {
    source.batch(0);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("pool bad: sample broken/7"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace q3d::pipeline::feed
