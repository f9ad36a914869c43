#include "pipeline/feed/shard_pool.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace q3d::pipeline::feed {
namespace {

namespace fs = std::filesystem;
using manifests::TableReader;

std::vector<fs::path> shards_below(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".h5") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<fs::path> find_shards(const fs::path& source) {
  std::error_code error;
  if (fs::is_regular_file(source, error)) return {source};
  if (!fs::is_directory(source, error)) {
    throw std::runtime_error(fmt::format("{}: neither a shard nor a folder", source.string()));
  }
  std::vector<fs::path> files = shards_below(source);
  if (files.empty() && fs::is_directory(source / "shards", error)) files = shards_below(source / "shards");
  if (files.empty()) {
    throw std::runtime_error(
        fmt::format("{}: no shard (*.h5) here or in its folder \"shards\"", source.string()));
  }
  return files;
}

template <typename T, std::size_t N>
std::array<T, N> read_row(const TableReader& table, const char* column, std::int64_t row) {
  const manifests::NumericColumn values = table.numeric(column, row, 1);
  std::array<T, N> result;
  std::copy_n(values.template as<T>().begin(), N, result.begin());
  return result;
}

bool read_flag(const TableReader& table, const char* column, std::int64_t row) {
  return read_row<std::uint8_t, 1>(table, column, row)[0] != 0;
}

manifests::Keypoints read_keypoints(const TableReader& table, std::int64_t row) {
  const auto px = read_row<double, manifests::kNumKeypoints * 2>(table, "keypoints_px", row);
  const auto v = read_row<float, manifests::kNumKeypoints>(table, "keypoints_v", row);
  const auto weight = read_row<float, manifests::kNumKeypoints>(table, "keypoints_weight", row);
  manifests::Keypoints keypoints;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    keypoints[i] = {px[2 * i], px[2 * i + 1], v[i], weight[i]};
  }
  return keypoints;
}

}  // namespace

ShardPool::ShardPool(std::string name, const std::vector<fs::path>& sources) : name_(std::move(name)) {
  for (const fs::path& source : sources) {
    for (const fs::path& file : find_shards(source)) {
      const manifests::ShardReader& shard = shards_.emplace_back(file);
      if (shard.header().image_encoding == manifests::ImageEncoding::reference) {
        throw std::runtime_error(fmt::format(
            "{}: a shard without pictures; training needs one that was built with \"images\": \"jpeg\" or "
            "\"png\"",
            file.string()));
      }
      first_.push_back(first_.back() + shard.rows());
    }
  }
}

std::vector<fs::path> ShardPool::files() const {
  std::vector<fs::path> files;
  for (const manifests::ShardReader& shard : shards_) files.push_back(shard.table().path());
  return files;
}

ShardPool::Place ShardPool::locate(std::int64_t index) const {
  if (index < 0 || index >= size()) {
    throw std::out_of_range(fmt::format("pool {}: sample {} of {}", name_, index, size()));
  }
  const auto next = std::upper_bound(first_.begin(), first_.end(), index);
  const auto shard = static_cast<std::size_t>(next - first_.begin()) - 1;
  return {&shards_[shard].table(), index - first_[shard]};
}

TrainingSample ShardPool::sample(std::int64_t index) const {
  const auto [table, row] = locate(index);
  TrainingSample sample;
  sample.crop = std::move(table->blobs("crop", row, 1).front());
  sample.crop_from_image = read_row<double, 6>(*table, "crop_from_image", row);
  const auto box = read_row<double, 3>(*table, "patch_box_px", row);
  sample.box = {box[0], box[1], box[2]};
  sample.keypoints = read_keypoints(*table, row);
  sample.species = table->text("species", row, 1).front();
  sample.family = static_cast<manifests::Family>(read_row<std::int8_t, 1>(*table, "family", row)[0]);
  sample.has_pose = read_flag(*table, "has_pose", row);
  sample.has_betas = read_flag(*table, "has_betas", row);
  sample.has_keypoints_3d = read_flag(*table, "has_keypoints_3d", row);
  sample.pose = read_row<float, manifests::kNumJoints * 9>(*table, "pose", row);
  sample.betas = read_row<float, manifests::kNumBetas>(*table, "betas", row);
  sample.keypoints_3d = read_row<float, manifests::kNumKeypoints * 3>(*table, "keypoints_3d", row);
  return sample;
}

std::set<std::string> ShardPool::species() const {
  std::set<std::string> names;
  for (const manifests::ShardReader& shard : shards_) {
    for (std::string& name : shard.table().text("species", 0, shard.rows())) {
      if (!name.empty()) names.insert(std::move(name));
    }
  }
  return names;
}

std::string ShardPool::id(std::int64_t index) const {
  const auto [table, row] = locate(index);
  return table->text("id", row, 1).front();
}

}  // namespace q3d::pipeline::feed
