// The tests go from the rendered world's annotation files to training batches. A label that was packed is the
// world's truth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "loaders/keypoints/topology.h"
#include "manifests/atomic_file.h"
#include "manifests/shard.h"
#include "pipeline/build/build.h"
#include "pipeline/dataset/verify.h"
#include "pipeline/feed/feed.h"
#include "pipeline/world/world.h"
#include "smal/camera.h"
#include "smal/tensors/body.h"
#include "smal/tensors/rotation.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::feed {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKeypoints = manifests::kNumKeypoints;
constexpr int kDraws = 48;  // of six to fourteen samples

// A finished build, its shards as training reads them, and one batch without augmentation.
struct Pool {
  build::BuildSummary summary;
  std::map<std::string, manifests::ShardSample> samples;  // by id
  FeedBatch batch;
  std::vector<const manifests::ShardSample*> drawn;  // of each slot of the batch
};

class PackedLabels : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(fs::temp_directory_path() / ("q3d_packed_labels_" + std::to_string(::getpid())));
    fs::remove_all(*folder_);
    world::WorldOptions options;
    options.out = *folder_ / "world";
    options.seed = 3;
    options.share = 0.01;
    world::make_world(options);
  }
  static void TearDownTestSuite() {
    fs::remove_all(*folder_);
    delete folder_;
  }

  static Pool packed(const std::string& set, const std::string& format, const std::string& annotations,
                     const std::string& role) {
    const nlohmann::json config = {{"name", set},
                                   {"datasets",
                                    {{{"name", set},
                                      {"format", format},
                                      {"root", (*folder_ / "world" / set).string()},
                                      {"annotations", annotations},
                                      {"role", role}}}},
                                   {"shards", {{"unit_size", 4}}}};
    run::RunOptions run;
    run.out = *folder_ / ("pool_" + set);
    run.quiet = true;
    Pool pool;
    pool.summary = build::build(config::parse_build_config(config, set), run);
    EXPECT_EQ(dataset::verify(pool.summary.folder, true).problems, std::vector<std::string>{});
    for (const dataset::ShardEntry& entry : pool.summary.dataset.shards) {
      for (auto& sample : manifests::read_shard(pool.summary.folder / entry.file).samples) {
        std::string id = sample.record.id;
        pool.samples.emplace(std::move(id), std::move(sample));
      }
    }
    const Feed feed = feed_of(pool, {.batch = kDraws, .augment = false});
    pool.batch = feed.batch(0);
    for (const std::string& id : feed.ids(0)) pool.drawn.push_back(&pool.samples.at(id));
    return pool;
  }

  // Options do not change which samples are drawn.
  static Feed feed_of(const Pool& pool, const FeedOptions& options) {
    std::vector<ShardPool> pools;
    pools.emplace_back("pool", std::vector<fs::path>{pool.summary.folder});
    return {std::move(pools), {1.0}, options, 11};
  }

  static fs::path* folder_;
};
fs::path* PackedLabels::folder_ = nullptr;

// Distances, in crop units, of the batch's visible keypoints from the projection of its bodies.
std::vector<double> distances(const Pool& pool) {
  std::vector<double> result;
  for (std::size_t slot = 0; slot < pool.drawn.size(); ++slot) {
    const auto& trans = pool.drawn[slot]->body.translation;
    for (std::size_t k = 0; k < kKeypoints; ++k) {
      const float* annotated = &pool.batch.keypoints_2d[(slot * kKeypoints + k) * 3];
      const float* body = &pool.batch.keypoints_3d[(slot * kKeypoints + k) * 4];
      EXPECT_EQ(body[3], 1.0F);
      if (annotated[2] == 0.0F) continue;
      const double depth = double{body[2]} + trans[2];
      const double x = smal::kFocalInCropUnits * (double{body[0]} + trans[0]) / depth;
      const double y = smal::kFocalInCropUnits * (double{body[1]} + trans[1]) / depth;
      result.push_back(std::hypot(x - annotated[0], y - annotated[1]));
    }
  }
  std::sort(result.begin(), result.end());
  return result;
}

void expect_all_packed(const Pool& pool, const std::string& kind) {
  const dataset::Counts& counts = pool.summary.dataset.counts;
  EXPECT_GT(counts.candidates, 4);
  EXPECT_EQ(counts.retained, counts.candidates);
  EXPECT_EQ(pool.summary.dataset.labels.at(manifests::label_kind_from_string(kind)), counts.candidates);
  EXPECT_EQ(static_cast<std::int64_t>(pool.samples.size()), counts.candidates);
}

// Families are those that the annotation file numbers.
void expect_families(const Pool& pool, const fs::path& annotations) {
  const nlohmann::json data = nlohmann::json::parse(manifests::read_file(annotations)).at("data");
  for (std::size_t slot = 0; slot < pool.drawn.size(); ++slot) {
    const std::string& id = pool.drawn[slot]->record.id;
    const std::size_t index = std::stoul(id.substr(id.find('#') + 1));
    EXPECT_EQ(pool.batch.family[slot], data.at(index).at("supercategory").get<std::int64_t>()) << id;
  }
}

torch::Tensor tensor_of(const std::vector<float>& values, std::vector<std::int64_t> shape) {
  return torch::tensor(values).view(shape);
}

// Returns how far the batch's 3D keypoints are from those that its pose and shape give. Both are relative to
// keypoint 0, as the loss sees them, since a body turns about its root and not about the origin.
double distance_from_body(const FeedBatch& batch, const fs::path& asset) {
  const smal::tensors::SmalBody body(smal::tensors::load_asset(asset));
  const c10::InferenceMode no_gradients;
  const torch::Tensor rotations = tensor_of(batch.rotations, {kDraws, manifests::kNumJoints, 3, 3});
  const torch::Tensor expected =
      body.keypoints(rotations, tensor_of(batch.betas, {kDraws, manifests::kNumBetas}));
  const torch::Tensor stored = tensor_of(batch.keypoints_3d, {kDraws, manifests::kNumKeypoints, 4});
  const auto relative = [](const torch::Tensor& points) { return points - points.narrow(1, 0, 1); };
  return (relative(stored.narrow(2, 0, 3)) - relative(expected)).abs().max().item<double>();
}

// The truth's batch against the body model: pose and shape give the 3D keypoints.
void expect_smal_keypoints(const Pool& pool, const fs::path& asset) {
  EXPECT_LT(distance_from_body(pool.batch, asset), 1e-4);
  const torch::Tensor rotations = tensor_of(pool.batch.rotations, {kDraws, manifests::kNumJoints, 3, 3});
  for (std::size_t slot = 0; slot < pool.drawn.size(); ++slot) {
    EXPECT_EQ(pool.batch.has_pose[slot], 1.0F);
    EXPECT_EQ(pool.batch.has_betas[slot], 1.0F);
    const auto& pose = pool.drawn[slot]->record.truth->pose_axis_angle;
    const torch::Tensor turns = smal::tensors::axis_angle_to_matrix_exact(
        torch::tensor(std::vector<float>(pose.begin(), pose.end())).view({manifests::kNumJoints, 3}));
    EXPECT_LT((turns - rotations[static_cast<std::int64_t>(slot)]).abs().max().item<double>(), 1e-5);
  }
}

TEST_F(PackedLabels, CtrlAni3dProjectsOntoItsLabels) {
  const Pool pool = packed("control_animal3dlatest", "prima", "train.json", "truth");
  expect_all_packed(pool, "truth");
  const std::vector<double> all = distances(pool);
  ASSERT_GT(all.size(), 500U);
  EXPECT_LT(all.back(), 1e-4);  // labels are projections, rounded to a hundredth of a pixel
  expect_smal_keypoints(pool, *folder_ / "world/assets/smal_synthetic.safetensors");
  expect_families(pool, *folder_ / "world/control_animal3dlatest/train.json");
  for (const auto& [id, sample] : pool.samples) EXPECT_LT(sample.judgement.final_error, 1e-4) << id;
}

TEST_F(PackedLabels, Animal3dProjectsOntoItsLabelsWithinTheirNoise) {
  const Pool pool = packed("animal3d", "prima", "train.json", "truth");
  expect_all_packed(pool, "truth");
  const std::vector<double> all = distances(pool);
  ASSERT_GT(all.size(), 400U);
  // Clear points deviate by 0.6 % of the crop in each coordinate, vague guesses by thrice that.
  EXPECT_LT(all[all.size() / 2], 0.012);
  EXPECT_LT(all[all.size() * 95 / 100], 0.06);
  EXPECT_GT(all[all.size() / 2], 0.002);
  expect_smal_keypoints(pool, *folder_ / "world/assets/smal_synthetic.safetensors");
  expect_families(pool, *folder_ / "world/animal3d/train.json");
}

// Returns the largest difference between rows of `width` numbers after the first number is negated and sides
// are exchanged.
double distance_from_mirror(const std::vector<float>& plain, const std::vector<float>& mirrored,
                            std::int64_t width) {
  const std::vector<int> flip = loaders::keypoints::topology("animal3d26").flip;
  const torch::Tensor order = torch::tensor(std::vector<std::int64_t>(flip.begin(), flip.end()));
  torch::Tensor expected = tensor_of(plain, {kDraws, manifests::kNumKeypoints, width}).index_select(1, order);
  expected.select(2, 0).neg_();
  return (tensor_of(mirrored, {kDraws, manifests::kNumKeypoints, width}) - expected)
      .abs()
      .max()
      .item<double>();
}

TEST_F(PackedLabels, AMirroredSampleIsTheMirroredBodyInTheMirroredPicture) {
  const Pool pool = packed("control_animal3dlatest", "prima", "train.json", "truth");
  loaders::pictures::AugmentOptions turned_over;
  turned_over.scale = turned_over.shift = turned_over.colour = turned_over.rotation_rate = 0.0;
  turned_over.mirror_rate = 1.0;
  const FeedBatch mirrored = feed_of(pool, {.batch = kDraws, .augmentation = turned_over}).batch(0);
  EXPECT_LT(distance_from_mirror(pool.batch.keypoints_2d, mirrored.keypoints_2d, 3), 1e-5);
  EXPECT_LT(distance_from_mirror(pool.batch.keypoints_3d, mirrored.keypoints_3d, 4), 1e-6);
  EXPECT_LT(distance_from_body(mirrored, *folder_ / "world/assets/smal_synthetic.safetensors"), 1e-3);
  EXPECT_EQ(mirrored.betas, pool.batch.betas);
  // Column x of one is column 256 - x of the other.
  const auto picture = [](const FeedBatch& batch) {
    return torch::from_blob(batch.images.get(), {kDraws, 3, 256, 256}).clone();
  };
  const torch::Tensor expected = picture(pool.batch).flip(3).narrow(3, 0, 255);
  const torch::Tensor difference = (picture(mirrored).narrow(3, 1, 255) - expected).abs();
  EXPECT_LT(difference.mean().item<double>(), 0.01);
  EXPECT_GT((picture(mirrored) - picture(pool.batch)).abs().mean().item<double>(), 0.1);
}

TEST_F(PackedLabels, SuperAnimalIsKeypointsAlone) {
  const Pool pool = packed("superanimal_quadruped", "superanimal", "annotations/train.json", "2d_only");
  expect_all_packed(pool, "2d_only");
  int labelled = 0;
  for (std::size_t slot = 0; slot < pool.drawn.size(); ++slot) {
    EXPECT_EQ(pool.batch.has_pose[slot], 0.0F);
    EXPECT_EQ(pool.batch.has_betas[slot], 0.0F);
    EXPECT_EQ(pool.batch.family[slot], static_cast<std::int64_t>(pool.drawn[slot]->record.family));
    for (std::size_t k = 0; k < kKeypoints; ++k) {
      EXPECT_EQ(pool.batch.keypoints_3d[(slot * kKeypoints + k) * 4 + 3], 0.0F);
      const float* point = &pool.batch.keypoints_2d[(slot * kKeypoints + k) * 3];
      if (point[2] == 0.0F) continue;
      ++labelled;
      EXPECT_LT(std::max(std::abs(point[0]), std::abs(point[1])), 0.75F);
    }
  }
  EXPECT_GT(labelled, 200);
}

}  // namespace
}  // namespace q3d::pipeline::feed
