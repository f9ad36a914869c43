// The samples of many shards under one running number.
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

// Reads take no lock and may run in many threads.
class ShardPool {
 public:
  // Each source is a shard, or a folder whose *.h5 files, or those of its subfolder "shards", are taken in
  // the order of their names. Throws std::runtime_error naming the path when a source holds no shard, a shard
  // is not sound, or it only refers to pictures.
  ShardPool(std::string name, const std::vector<std::filesystem::path>& sources);

  const std::string& name() const { return name_; }
  std::int64_t size() const { return first_.back(); }
  std::vector<std::filesystem::path> files() const;  // the shards, in the order of their samples
  // Throw std::out_of_range for a sample that the pool lacks and std::runtime_error when a shard cannot be
  // read.
  TrainingSample sample(std::int64_t index) const;
  std::string id(std::int64_t index) const;
  std::set<std::string> species() const;  // all names but the empty one

 private:
  struct Place {
    const manifests::TableReader* table;
    std::int64_t row;
  };
  Place locate(std::int64_t index) const;

  std::string name_;
  std::vector<manifests::ShardReader> shards_;
  std::vector<std::int64_t> first_{0};  // running number of each shard's first sample, and the total
};

}  // namespace q3d::pipeline::feed
