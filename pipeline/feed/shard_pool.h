// Numbers the samples of many shards consecutively.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "loaders/pictures/crop.h"
#include "manifests/sample.h"
#include "manifests/shard.h"

namespace q3d::pipeline::feed {

// The part of a sample that training needs, in the shard's units and frames.
struct TrainingSample {
  std::vector<std::byte> crop;  // encoded picture
  loaders::pictures::Affine crop_from_image{};
  loaders::pictures::SquareBox box;
  manifests::Keypoints keypoints;
  std::string species;  // empty when unknown
  manifests::Family family = manifests::Family::none;
  bool has_pose = false;
  bool has_betas = false;
  bool has_keypoints_3d = false;
  smal::Pose pose{};
  smal::Betas betas{};
  smal::Keypoints3d keypoints_3d{};
};

// Returns the shards of a pool's sources, in the order of their samples. A source is a shard, or a folder
// whose *.h5 files, or those of its subfolder "shards", are taken in the order of their names. Throws
// std::runtime_error that names the path if a source holds no shard.
std::vector<std::filesystem::path> shard_files(const std::vector<std::filesystem::path>& sources);

// Reads take no lock and may run in many threads.
class ShardPool {
 public:
  // Opens shard_files(sources). Throws std::runtime_error that names the path if a shard is damaged or only
  // refers to pictures, and as shard_files does.
  ShardPool(std::string name, const std::vector<std::filesystem::path>& sources);

  // Removes the samples at these positions, which refer to the pool before the call. Later samples move up.
  // Throws std::out_of_range.
  void leave_out(const std::vector<std::int64_t>& positions);

  const std::string& name() const { return name_; }
  std::int64_t size() const { return static_cast<std::int64_t>(places_.size()); }
  // These throw std::out_of_range for a sample that the pool lacks and std::runtime_error if a shard cannot
  // be read.
  TrainingSample sample(std::int64_t index) const;
  std::string id(std::int64_t index) const;
  std::set<std::string> species() const;   // all names but the empty one
  std::set<std::string> pictures() const;  // SHA-256 of the pictures that its shards were made from

 private:
  struct Place {
    const manifests::TableReader* table;
    std::int64_t row;
  };
  Place locate(std::int64_t index) const;
  std::set<std::string> texts(const char* column) const;

  struct ShardAndRow {
    std::uint32_t shard = 0;
    std::uint32_t row = 0;
  };
  std::string name_;
  std::vector<manifests::ShardReader> shards_;
  std::vector<ShardAndRow> places_;  // shard and row of every sample
};

}  // namespace q3d::pipeline::feed
