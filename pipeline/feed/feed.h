// Makes training batches from shards: draw, decode, augment, normalise.
#pragma once

#include <oneapi/tbb/task_arena.h>

#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "loaders/pictures/augment.h"
#include "pipeline/feed/draw_sequence.h"
#include "pipeline/feed/image_buffers.h"
#include "pipeline/feed/shard_pool.h"

namespace q3d::pipeline::feed {

// The weight of a 2D keypoint in the losses. The official code takes the annotation's v as it is (`raw_v`),
// so that a 2 counts double. `label` takes 1, or a detector's likelihood.
enum class KeypointWeight { label, raw_v };

struct FeedOptions {
  int batch = 48;  // of all ranks together
  bool augment = true;
  loaders::pictures::AugmentOptions augmentation{};
  KeypointWeight keypoint_weight = KeypointWeight::label;
  int threads = 0;  // threads that decode and warp; 0 = all cores. Changes no bit
  // With several ranks, each takes its contiguous part of every batch, so that together they see the same
  // batches as a single rank.
  int rank = 0;
  int ranks = 1;
};

// A rank's part of a batch in the network's units. Arrays are row-major, the batch first; B = size.
struct FeedBatch {
  std::int64_t size = 0;
  std::int64_t first_draw = 0;             // of the joint batch
  ImageBuffers::Buffer images;             // (B, 3, 256, 256) normalised
  std::vector<float> keypoints_2d;         // (B, 26, 3): x, y in crop units and a weight
  std::vector<float> keypoints_3d;         // (B, 26, 4): SMAL units, and 1 or 0
  std::vector<float> rotations;            // (B, 35, 3, 3); identities where there are none
  std::vector<float> betas;                // (B, 41); zeros where there are none
  std::vector<float> has_pose, has_betas;  // (B)
  std::vector<std::int64_t> family;        // (B), -1 for none
  std::vector<std::int64_t> species;       // (B), index into Feed::species(), -1 for unknown
};

// Thread-safe. A batch depends only on pools, options (without the threads), seed and position.
class Feed {
 public:
  // `weights` has one number for each pool. Throws std::invalid_argument, also if the ranks cannot have equal
  // parts.
  Feed(std::vector<ShardPool> pools, const std::vector<double>& weights, const FeedOptions& options,
       std::uint64_t seed);

  // Returns this rank's part of the draws [first_draw, first_draw + options.batch). Throws std::runtime_error
  // that names the sample if its picture cannot be decoded.
  FeedBatch batch(std::int64_t first_draw) const;
  // Returns the ids of the samples of a joint batch, for messages.
  std::vector<std::string> ids(std::int64_t first_draw) const;
  // Returns the pools' species, sorted by name.
  const std::vector<std::string>& species() const { return species_; }
  std::int64_t batch_size() const { return options_.batch; }  // of all ranks together

 private:
  FeedBatch empty_batch(std::int64_t first_draw) const;
  void fill(FeedBatch& batch, std::int64_t slot) const;

  std::vector<ShardPool> pools_;
  std::vector<std::string> species_;
  DrawSequence draws_;
  FeedOptions options_;
  ImageBuffers images_;
  std::unique_ptr<tbb::task_arena> arena_;
};

// Gives consecutive batches, and prepares `ahead` of them in the background. The feed must outlive it.
class FeedStream {
 public:
  FeedStream(const Feed& feed, std::int64_t first_draw, int ahead);
  FeedBatch next();

 private:
  const Feed& feed_;
  std::int64_t next_draw_;
  std::size_t ahead_;
  std::deque<std::future<FeedBatch>> prepared_;
};

}  // namespace q3d::pipeline::feed
