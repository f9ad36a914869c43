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
  std::array<T, N> result{};
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

std::vector<fs::path> shard_files(const std::vector<fs::path>& sources) {
  std::vector<fs::path> files;
  for (const fs::path& source : sources) {
    const std::vector<fs::path> found = find_shards(source);
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

ShardPool::ShardPool(std::string name, const std::vector<fs::path>& sources) : name_(std::move(name)) {
  for (const fs::path& file : shard_files(sources)) {
    const manifests::ShardReader& shard = shards_.emplace_back(file);
    if (shard.header().image_encoding == manifests::ImageEncoding::reference) {
      throw std::runtime_error(fmt::format(
          "{}: a shard without pictures; training needs one that was built with \"images\": \"jpeg\" or "
          "\"png\"",
          file.string()));
    }
    for (std::int64_t row = 0; row < shard.rows(); ++row) {
      places_.push_back({static_cast<std::uint32_t>(shards_.size() - 1), static_cast<std::uint32_t>(row)});
    }
  }
}

void ShardPool::leave_out(const std::vector<std::int64_t>& positions) {
  const std::set<std::int64_t> left_out(positions.begin(), positions.end());
  if (!left_out.empty() && (*left_out.begin() < 0 || *left_out.rbegin() >= size())) {
    throw std::out_of_range(
        fmt::format("pool {}: leave_out: a position outside its {} samples", name_, size()));
  }
  std::int64_t position = 0;
  std::erase_if(places_, [&](const ShardAndRow&) { return left_out.contains(position++); });
}

ShardPool::Place ShardPool::locate(std::int64_t index) const {
  if (index < 0 || index >= size()) {
    throw std::out_of_range(fmt::format("pool {}: sample {} of {}", name_, index, size()));
  }
  const ShardAndRow& place = places_[static_cast<std::size_t>(index)];
  return {&shards_[place.shard].table(), place.row};
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

// Returns the texts of a column, except the empty one.
std::set<std::string> ShardPool::texts(const char* column) const {
  std::set<std::string> texts;
  for (const manifests::ShardReader& shard : shards_) {
    for (std::string& text : shard.table().text(column, 0, shard.rows())) {
      if (!text.empty()) texts.insert(std::move(text));
    }
  }
  return texts;
}

std::set<std::string> ShardPool::species() const {
  return texts("species");
}

std::set<std::string> ShardPool::pictures() const {
  return texts("image_sha256");
}

std::string ShardPool::id(std::int64_t index) const {
  const auto [table, row] = locate(index);
  return table->text("id", row, 1).front();
}

}  // namespace q3d::pipeline::feed
