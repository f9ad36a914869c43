#include "pipeline/dataset/inspect.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "loaders/keypoints/topology.h"
#include "manifests/record_json.h"
#include "pipeline/dataset/published_dataset.h"
#include "smal/numbers.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// Returns the row of a shard with this id, else the only row whose id contains it.
std::optional<std::int64_t> row_of(const manifests::ShardReader& shard, const std::string& id) {
  const std::vector<std::string> ids = shard.table().text("id", 0, shard.rows());
  const auto found = std::find(ids.begin(), ids.end(), id);
  if (found != ids.end()) return found - ids.begin();
  const auto contains = [&](const std::string& each) { return each.find(id) != std::string::npos; };
  const auto first = std::find_if(ids.begin(), ids.end(), contains);
  const bool is_only = first != ids.end() && std::none_of(first + 1, ids.end(), contains);
  return is_only ? std::optional<std::int64_t>(first - ids.begin()) : std::nullopt;
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
      {"camera", smal::numbers_of(sample.body.camera)},
      {"trans", sample.body.translation},
      {"betas", sample.body.betas},
      {"pose", sample.body.pose},
      {"keypoints_3d", sample.keypoints_3d},
      {"projected_2d", smal::numbers_of(sample.projected_2d)},
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
  return {{"shard", path.string()},
          {"schema", shard.header.schema},
          {"dataset", shard.header.dataset},
          {"unit", shard.header.unit},
          {"images", manifests::to_string(shard.header.image_encoding)},
          {"keypoint_names", loaders::keypoints::topology("animal3d26").keypoints},
          {"samples", samples}};
}

}  // namespace

ordered_json describe(const fs::path& path) {
  if (!fs::is_directory(path)) return describe_shard(path);
  const PublishedDataset dataset(path);  // refuses what it does not know
  ordered_json document = read_dataset_document(dataset.folder());
  document["folder"] = dataset.folder().string();
  document["keypoint_names"] = loaders::keypoints::topology("animal3d26").keypoints;
  return document;
}

FoundSample find_sample(const fs::path& path, const std::string& id) {
  if (fs::is_directory(path)) {
    const PublishedDataset dataset(path);
    const VerdictRow row = dataset.verdict(id);
    if (row.label) return {dataset.shard_file(dataset.shard_of_unit(row.label->shard)), dataset.sample(row)};
    throw std::runtime_error(fmt::format(
        "{}: {} has no label, so no shard holds it: {} ({}). `quadruped3d explain` tells what is known of it",
        dataset.folder().string(), row.id, manifests::to_string(row.judgement.verdict),
        manifests::to_string(row.judgement.reason)));
  }
  const manifests::ShardReader shard(path);
  if (const auto row = row_of(shard, id)) return {path, std::move(shard.samples(*row, 1).front())};
  throw std::runtime_error(
      fmt::format("{}: no sample, or more than one, has the id {} or contains it; verdicts.csv of the "
                  "dataset lists every candidate with its shard",
                  path.string(), id));
}

ordered_json describe_sample(const fs::path& path, const std::string& id) {
  const FoundSample found = find_sample(path, id);
  return describe_whole(found.shard, found.sample);
}

std::vector<manifests::ShardSample> spread_samples(const fs::path& path, int count) {
  std::vector<std::pair<fs::path, std::int64_t>> shards;  // with their rows
  if (fs::is_directory(path)) {
    const PublishedDataset dataset(path);
    for (const ShardEntry& shard : dataset.manifest().shards) {
      shards.emplace_back(dataset.shard_file(shard), shard.rows);
    }
  } else {
    shards.emplace_back(path, manifests::ShardReader(path).rows());
  }
  std::int64_t total = 0;
  for (const auto& [file, rows] : shards) total += rows;
  const std::int64_t wanted = std::min<std::int64_t>(count, total);
  std::vector<manifests::ShardSample> chosen;
  std::int64_t first = 0;  // row of the shard's first sample, counted through all shards
  for (const auto& [file, rows] : shards) {
    std::optional<manifests::ShardReader> shard;  // opened when one of its rows is needed
    for (auto next = static_cast<std::int64_t>(chosen.size()); next < wanted; ++next) {
      const std::int64_t row = next * total / wanted - first;
      if (row >= rows) break;
      if (!shard) shard.emplace(file);
      chosen.push_back(std::move(shard->samples(row, 1).front()));
    }
    first += rows;
  }
  return chosen;
}

}  // namespace q3d::pipeline::dataset
