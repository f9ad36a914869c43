#include "pipeline/feed/feed.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <span>
#include <stdexcept>

#include "loaders/keypoints/mirror.h"
#include "loaders/pictures/encode.h"
#include "loaders/pictures/stored_crop.h"
#include "smal/numbers.h"

namespace q3d::pipeline::feed {
namespace {

constexpr std::size_t kKeypoints = manifests::kNumKeypoints;
constexpr std::size_t kRotationNumbers = manifests::kNumJoints * 9;
constexpr std::size_t kImageNumbers = 3 * loaders::pictures::kPatchSidePx * loaders::pictures::kPatchSidePx;

std::vector<PoolShare> shares(const std::vector<ShardPool>& pools, const std::vector<double>& weights) {
  if (pools.size() != weights.size()) {
    throw std::invalid_argument(fmt::format("{} pools and {} weights", pools.size(), weights.size()));
  }
  std::vector<PoolShare> result;
  for (std::size_t i = 0; i < pools.size(); ++i) result.push_back({pools[i].size(), weights[i]});
  return result;
}

std::vector<std::string> all_species(const std::vector<ShardPool>& pools) {
  std::set<std::string> names;
  for (const ShardPool& pool : pools) names.merge(pool.species());
  return {names.begin(), names.end()};
}

// Returns the index in the sorted list, or -1 for a name that it lacks.
std::int64_t number_of(const std::string& name, const std::vector<std::string>& names) {
  const auto found = std::lower_bound(names.begin(), names.end(), name);
  return found != names.end() && *found == name ? found - names.begin() : -1;
}

template <typename T>
std::span<T> row(std::vector<T>& values, std::int64_t slot, std::size_t width) {
  return std::span(values).subspan(static_cast<std::size_t>(slot) * width, width);
}

// Turns the global orientation by -rotation_deg about the camera's axis: the animal turns with the picture.
void turn_orientation(std::span<float> rotation, double rotation_deg) {
  const double angle_rad = -rotation_deg * std::numbers::pi / 180.0;
  const double cosine = std::cos(angle_rad);
  const double sine = std::sin(angle_rad);
  for (std::size_t column = 0; column < 3; ++column) {
    const double x = rotation[column];
    const double y = rotation[3 + column];
    rotation[column] = static_cast<float>(cosine * x - sine * y);
    rotation[3 + column] = static_cast<float>(sine * x + cosine * y);
  }
}

void fill_keypoints_2d(const TrainingSample& sample, const loaders::pictures::Affine& patch_from_image,
                       KeypointWeight weight, bool mirror, std::span<float> out) {
  smal::CropKeypoints keypoints = loaders::pictures::keypoints_to_crop(sample.keypoints, patch_from_image);
  if (weight == KeypointWeight::raw_v) {  // a v below 0 would reward errors
    for (std::size_t i = 0; i < kKeypoints; ++i) keypoints[i].weight = std::max(0.0F, sample.keypoints[i].v);
  }
  const auto numbers = smal::numbers_of(keypoints);
  std::copy(numbers.begin(), numbers.end(), out.begin());
  if (mirror) loaders::keypoints::swap_keypoint_sides(out, 3);
}

void fill_keypoints_3d(const TrainingSample& sample, const loaders::pictures::Augmentation& augmentation,
                       std::span<float> out) {
  const auto keypoints =
      loaders::pictures::rotate_keypoints_3d(sample.keypoints_3d, augmentation.rotation_deg);
  for (std::size_t i = 0; sample.has_keypoints_3d && i < kKeypoints; ++i) {
    std::copy_n(keypoints.begin() + static_cast<std::ptrdiff_t>(3 * i), 3,
                out.begin() + static_cast<std::ptrdiff_t>(4 * i));
    if (augmentation.mirror) out[4 * i] = -out[4 * i];
    out[4 * i + 3] = 1.0F;
  }
  if (augmentation.mirror) loaders::keypoints::swap_keypoint_sides(out, 4);
}

void fill_body(const TrainingSample& sample, const loaders::pictures::Augmentation& augmentation,
               FeedBatch& batch, std::int64_t slot) {
  const auto at = static_cast<std::size_t>(slot);
  fill_keypoints_3d(sample, augmentation, row(batch.keypoints_3d, slot, kKeypoints * 4));
  const std::span<float> rotations = row(batch.rotations, slot, kRotationNumbers);
  if (sample.has_pose) {
    std::copy(sample.pose.begin(), sample.pose.end(), rotations.begin());
    turn_orientation(rotations.first(9), augmentation.rotation_deg);
    if (augmentation.mirror) loaders::keypoints::mirror_pose(rotations);
  } else {
    for (std::size_t i = 0; i < kRotationNumbers; i += 9) {
      rotations[i] = rotations[i + 4] = rotations[i + 8] = 1.0F;
    }
  }
  if (sample.has_betas) {
    std::copy(sample.betas.begin(), sample.betas.end(), row(batch.betas, slot, sample.betas.size()).begin());
  }
  batch.has_pose[at] = sample.has_pose ? 1.0F : 0.0F;
  batch.has_betas[at] = sample.has_betas ? 1.0F : 0.0F;
  batch.family[at] = static_cast<std::int64_t>(sample.family);
}

const FeedOptions& checked(const FeedOptions& options) {
  if (options.batch < 1) throw std::invalid_argument("a batch must hold at least one sample");
  if (options.ranks < 1 || options.rank < 0 || options.rank >= options.ranks) {
    throw std::invalid_argument(fmt::format("rank {} of {} ranks", options.rank, options.ranks));
  }
  if (options.batch % options.ranks != 0) {
    throw std::invalid_argument(fmt::format(
        "a batch of {} samples cannot be shared equally by {} ranks; choose \"batch\" as a multiple of their "
        "number",
        options.batch, options.ranks));
  }
  return options;
}

int arena_threads(int wanted) {
  if (wanted > 0) return wanted;
  return tbb::task_arena::automatic;
}

}  // namespace

Feed::Feed(std::vector<ShardPool> pools, const std::vector<double>& weights, const FeedOptions& options,
           std::uint64_t seed)
    : pools_(std::move(pools)),
      species_(all_species(pools_)),
      draws_(shares(pools_, weights), seed),
      options_(checked(options)),
      images_(static_cast<std::size_t>(options.batch / options.ranks) * kImageNumbers),
      arena_(std::make_unique<tbb::task_arena>(arena_threads(options.threads))) {}

FeedBatch Feed::empty_batch(std::int64_t first_draw) const {
  FeedBatch batch;
  batch.size = options_.batch / options_.ranks;
  batch.first_draw = first_draw;
  batch.images = images_.take();
  const auto count = static_cast<std::size_t>(batch.size);
  batch.keypoints_2d.resize(count * kKeypoints * 3);
  batch.keypoints_3d.resize(count * kKeypoints * 4);
  batch.rotations.resize(count * kRotationNumbers);
  batch.betas.resize(count * manifests::kNumBetas);
  batch.has_pose.resize(count);
  batch.has_betas.resize(count);
  batch.family.resize(count);
  batch.species.resize(count);
  return batch;
}

FeedBatch Feed::batch(std::int64_t first_draw) const {
  FeedBatch batch = empty_batch(first_draw);
  arena_->execute(
      [&] { tbb::parallel_for(std::int64_t{0}, batch.size, [&](std::int64_t slot) { fill(batch, slot); }); });
  return batch;
}

void Feed::fill(FeedBatch& batch, std::int64_t slot) const {
  const Draw draw = draws_.at(batch.first_draw + options_.rank * batch.size + slot);
  const ShardPool& pool = pools_[draw.pool];
  const TrainingSample sample = pool.sample(draw.sample);
  loaders::pictures::Augmentation augmentation;
  if (options_.augment) {
    std::mt19937_64 engine(draw.seed);
    augmentation = loaders::pictures::draw_augmentation(options_.augmentation, engine);
  }
  const loaders::pictures::Affine patch_from_image =
      loaders::pictures::augmented_patch_from_image(sample.box, augmentation);
  const loaders::pictures::Affine patch_from_crop =
      loaders::pictures::patch_from_stored_crop(patch_from_image, sample.crop_from_image);
  loaders::pictures::StoredRegion region;
  try {
    region = loaders::pictures::decode_stored_for(sample.crop, patch_from_crop);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("pool {}: sample {}: its stored crop cannot be decoded: {}; `verify` checks the shards",
                    pool.name(), pool.id(draw.sample), error.what()));
  }
  const loaders::pictures::Affine crop_from_region{1.0, 0.0, static_cast<double>(region.origin.x),
                                                   0.0, 1.0, static_cast<double>(region.origin.y)};
  const loaders::pictures::Patch patch = loaders::pictures::warp_patch(
      region.rgb, cv::Mat(), loaders::pictures::compose(patch_from_crop, crop_from_region));
  loaders::pictures::normalise_patch(
      patch.rgb, augmentation.colour,
      {batch.images.get() + static_cast<std::size_t>(slot) * kImageNumbers, kImageNumbers});
  fill_keypoints_2d(sample, patch_from_image, options_.keypoint_weight, augmentation.mirror,
                    row(batch.keypoints_2d, slot, kKeypoints * 3));
  fill_body(sample, augmentation, batch, slot);
  batch.species[static_cast<std::size_t>(slot)] = number_of(sample.species, species_);
}

std::vector<std::string> Feed::ids(std::int64_t first_draw) const {
  std::vector<std::string> ids;
  for (std::int64_t slot = 0; slot < options_.batch; ++slot) {
    const Draw draw = draws_.at(first_draw + slot);
    ids.push_back(pools_[draw.pool].id(draw.sample));
  }
  return ids;
}

FeedStream::FeedStream(const Feed& feed, std::int64_t first_draw, int ahead)
    : feed_(feed), next_draw_(first_draw), ahead_(static_cast<std::size_t>(std::max(0, ahead))) {}

FeedBatch FeedStream::next() {
  // Keep `ahead` batches and the requested one in preparation. The requested one is computed here if `ahead`
  // is 0.
  while (prepared_.size() <= ahead_) {
    const auto policy = ahead_ == 0 ? std::launch::deferred : std::launch::async;
    prepared_.push_back(
        std::async(policy, [&feed = feed_, first = next_draw_] { return feed.batch(first); }));
    next_draw_ += feed_.batch_size();
  }
  std::future<FeedBatch> first = std::move(prepared_.front());
  prepared_.pop_front();
  return first.get();
}

}  // namespace q3d::pipeline::feed
