// Writes shards and what the feed makes of them, for the tests of other readers (python/tests).
//
//   dump_feed shards FOLDER      writes png.h5, jpeg.h5 and single.h5, with samples with and without a body,
//                                and body.h5, whose samples are as a build leaves them
//   dump_feed batches REQUEST    writes the arrays of one batch into files of float32, and prints its draws
//   as
//                                JSON. REQUEST is a JSON file: sources (a list of lists of paths), weights,
//                                seed, first, count, augment (null or the options), raw_v, out (a folder).
#include <fmt/format.h>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "loaders/pictures/augment.h"
#include "loaders/pictures/encode.h"
#include "manifests/json_file.h"
#include "pipeline/feed/draw_sequence.h"
#include "pipeline/feed/feed.h"
#include "tests/pipeline/exports/body_samples.h"
#include "tests/pipeline/feed/sample_shards.h"

namespace q3d::pipeline::feed {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

void write_jpeg_shard(const fs::path& path) {
  manifests::ShardHeader header;
  header.dataset = "jpeg";
  header.version = "v";
  header.image_encoding = manifests::ImageEncoding::jpeg;
  std::vector<manifests::ShardSample> samples;
  for (unsigned i = 0; i < 6; ++i) {
    manifests::ShardSample sample =
        testing::shard_sample("jpeg/train/" + std::to_string(i), 50 + i, i % 3 != 0);
    sample.crop =
        loaders::pictures::encode_jpeg(loaders::pictures::decode_stored(sample.crop, 3), 95 - 10 * (i % 2));
    sample.record.species = i == 4 ? "" : sample.record.species;
    for (std::size_t k = 0; k < sample.record.keypoints.size(); ++k) {  // all kinds of v that files have
      constexpr std::array<float, 4> kRaw{-1.0F, 0.0F, 1.0F, 2.0F};
      sample.record.keypoints[k].v = kRaw[k % 4];
      sample.record.keypoints[k].weight = k % 4 < 2 ? 0.0F : 0.25F * static_cast<float>(k % 5);
    }
    samples.push_back(std::move(sample));
  }
  manifests::write_shard(path, header, samples);
}

void write_shards(const fs::path& folder) {
  testing::write_sample_shard(folder / "png.h5", "png/train", 7, 10);
  testing::write_sample_shard(folder / "single.h5", "single/test", 1, 30);
  write_jpeg_shard(folder / "jpeg.h5");
  testing::write_body_shard(folder / "body.h5", "a", 6, 1);
}

FeedOptions options_of(const json& request) {
  FeedOptions options;
  options.batch = request.at("count").get<int>();
  options.augment = !request.at("augment").is_null();
  options.keypoint_weight = request.at("raw_v").get<bool>() ? KeypointWeight::raw_v : KeypointWeight::label;
  if (!options.augment) return options;
  const json& augment = request.at("augment");
  options.augmentation = {augment.at("scale").get<double>(),         augment.at("rotation_deg").get<double>(),
                          augment.at("rotation_rate").get<double>(), augment.at("shift").get<double>(),
                          augment.at("colour").get<double>(),        augment.at("mirror_rate").get<double>()};
  return options;
}

json describe(const Draw& draw, const FeedOptions& options) {
  loaders::pictures::Augmentation drawn;
  if (options.augment) {
    std::mt19937_64 engine(draw.seed);
    drawn = loaders::pictures::draw_augmentation(options.augmentation, engine);
  }
  return {{"pool", draw.pool},
          {"sample", draw.sample},
          {"seed", draw.seed},
          {"scale", drawn.scale},
          {"rotation_deg", drawn.rotation_deg},
          {"shift_x", drawn.shift_x},
          {"shift_y", drawn.shift_y},
          {"colour", drawn.colour},
          {"mirror", drawn.mirror}};
}

void write_floats(const fs::path& path, const float* values, std::size_t count) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(float)));
  if (!file.flush()) throw std::runtime_error(path.string() + ": cannot be written");
}

void write_batch(const fs::path& out, const FeedBatch& batch) {
  write_floats(out / "image", batch.images.get(), static_cast<std::size_t>(batch.size) * 3 * 256 * 256);
  const auto write = [&](const char* name, const std::vector<float>& values) {
    write_floats(out / name, values.data(), values.size());
  };
  write("keypoints_2d", batch.keypoints_2d);
  write("keypoints_3d", batch.keypoints_3d);
  write("rotations", batch.rotations);
  write("betas", batch.betas);
  write("has_pose", batch.has_pose);
  write("has_betas", batch.has_betas);
}

void dump_batch(const json& request) {
  std::vector<ShardPool> pools;
  std::vector<PoolShare> shares;
  const auto weights = request.at("weights").get<std::vector<double>>();
  for (const json& sources : request.at("sources")) {
    pools.emplace_back("pool", sources.get<std::vector<fs::path>>());
    shares.push_back({pools.back().size(), weights.at(shares.size())});
  }
  const FeedOptions options = options_of(request);
  const auto seed = request.at("seed").get<std::uint64_t>();
  const auto first = request.at("first").get<std::int64_t>();
  const Feed feed(std::move(pools), weights, options, seed);
  const FeedBatch batch = feed.batch(first);
  write_batch(request.at("out").get<fs::path>(), batch);
  const DrawSequence sequence(shares, seed);
  json draws = json::array();
  for (std::int64_t i = 0; i < batch.size; ++i) draws.push_back(describe(sequence.at(first + i), options));
  const json document = {{"draws", draws},
                         {"ids", feed.ids(first)},
                         {"names", feed.species()},
                         {"family", batch.family},
                         {"species", batch.species}};
  fmt::print("{}\n", document.dump());
}

}  // namespace
}  // namespace q3d::pipeline::feed

int main(int argc, char** argv) {
  const std::string job = argc == 3 ? argv[1] : "";
  try {
    if (job == "shards") {
      q3d::pipeline::feed::write_shards(argv[2]);
    } else if (job == "batches") {
      q3d::pipeline::feed::dump_batch(q3d::manifests::read_json_file(argv[2]));
    } else {
      fmt::print(stderr, "usage: dump_feed shards FOLDER | batches REQUEST\n");
      return 2;
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "dump_feed: {}\n", error.what());
    return 1;
  }
  return 0;
}
