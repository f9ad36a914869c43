#include "pipeline/dataset/inspect.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/record_json.h"
#include "pipeline/dataset/dataset_manifest.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

std::vector<fs::path> shard_files(const fs::path& path) {
  if (!fs::is_directory(path)) return {path};
  const fs::path folder = dataset_folder(path);
  std::vector<fs::path> files;
  for (const ShardEntry& shard : read_dataset_manifest(folder).shards) files.push_back(folder / shard.file);
  return files;
}

ordered_json describe_judgement(const manifests::Judgement& judgement) {
  return {{"verdict", manifests::to_string(judgement.verdict)},
          {"initial_error", judgement.initial_error},
          {"final_error", judgement.final_error},
          {"gain", judgement.gain},
          {"iterations", judgement.iterations},
          {"best_iteration", judgement.best_iteration}};
}

ordered_json describe_whole(const fs::path& shard, const manifests::ShardSample& sample) {
  nlohmann::json record;
  manifests::to_json(record, sample.record);
  return {
      {"shard", shard.string()},
      {"label", manifests::to_string(sample.label_kind)},
      {"judgement", describe_judgement(sample.judgement)},
      {"image_sha256", sample.image_sha256},
      {"image_size_px", {sample.image_width_px, sample.image_height_px}},
      {"stored_crop",
       {{"side_px", sample.crop_side_px},
        {"bytes", sample.crop.size()},
        {"from_image", sample.crop_from_image}}},
      {"has",
       {{"pose", sample.has_pose}, {"betas", sample.has_betas}, {"keypoints_3d", sample.has_keypoints_3d}}},
      {"camera", sample.camera},
      {"trans", sample.trans},
      {"betas", sample.betas},
      {"pose", sample.pose},
      {"keypoints_3d", sample.keypoints_3d},
      {"projected_2d", sample.projected_2d},
      {"record", record}};
}

ordered_json describe_shard(const fs::path& path) {
  const manifests::Shard shard = manifests::read_shard(path);
  ordered_json samples = ordered_json::array();
  for (const auto& sample : shard.samples) {
    samples.push_back({{"id", sample.record.id},
                       {"label", manifests::to_string(sample.label_kind)},
                       {"species", sample.record.species},
                       {"initial_error", sample.judgement.initial_error},
                       {"final_error", sample.judgement.final_error},
                       {"picture_bytes", sample.crop.size()}});
  }
  return {
      {"shard", path.string()},    {"schema", shard.header.schema},         {"dataset", shard.header.dataset},
      {"unit", shard.header.unit}, {"images", shard.header.image_encoding}, {"samples", samples}};
}

}  // namespace

ordered_json describe(const fs::path& path) {
  if (!fs::is_directory(path)) return describe_shard(path);
  const fs::path folder = dataset_folder(path);
  read_dataset_manifest(folder);  // refuses what it does not know
  ordered_json document = ordered_json::parse(manifests::read_file(folder / "dataset.json"));
  document["folder"] = folder.string();
  return document;
}

ordered_json describe_sample(const fs::path& path, const std::string& id) {
  for (const fs::path& file : shard_files(path)) {
    const manifests::ShardReader shard(file);
    const std::vector<std::string> ids = shard.table().text("id", 0, shard.rows());
    const auto found = std::find(ids.begin(), ids.end(), id);
    if (found != ids.end()) return describe_whole(file, shard.samples(found - ids.begin(), 1).front());
  }
  throw std::runtime_error(
      fmt::format("{}: no sample {} in the shards; verdicts.csv lists every candidate with what "
                  "became of it",
                  path.string(), id));
}

std::vector<manifests::ShardSample> spread_samples(const fs::path& path, int count) {
  std::vector<manifests::ShardReader> shards;
  std::int64_t total = 0;
  for (const fs::path& file : shard_files(path)) total += shards.emplace_back(file).rows();
  const std::int64_t wanted = std::min<std::int64_t>(count, total);
  std::vector<manifests::ShardSample> chosen;
  std::int64_t first = 0;
  for (const manifests::ShardReader& shard : shards) {
    for (auto next = static_cast<std::int64_t>(chosen.size()); next < wanted; ++next) {
      const std::int64_t row = next * total / wanted - first;
      if (row >= shard.rows()) break;
      chosen.push_back(std::move(shard.samples(row, 1).front()));
    }
    first += shard.rows();
  }
  return chosen;
}

}  // namespace q3d::pipeline::dataset
