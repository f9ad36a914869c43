// A tiny training on drawn shards, and the damage that tests do to its files.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/sealed_json.h"
#include "model/checkpoint.h"
#include "model/prima.h"
#include "pipeline/training/training_run.h"
#include "smal/tensors/asset.h"
#include "tests/pipeline/feed/sample_shards.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::training {

using settings::Decay;
using settings::Objective;
using settings::PoolConfig;
using settings::TrainingConfig;

class TrainingRun : public ::testing::Test {
 protected:
  TrainingRun() {
    model::PrimaConfig sizes = model::named_config("tiny");
    sizes.embed_dim = 32, sizes.heads = 2;
    sizes.clip_width = 32, sizes.clip_layers = 1, sizes.clip_heads = 2, sizes.clip_out = 16;
    sizes.dec_dim = 32, sizes.dec_heads = 2, sizes.dec_ffn = 32;
    sizes.drop_path = 0.3;
    model::write_initial_checkpoint(path("initial"), sizes, 3);
    smal::tensors::save_asset(path("asset"), testing::load_parity_asset(testing::parity_dir()));
    testing::write_sample_shard(path("first.h5"), "first", 5, 10);
    testing::write_sample_shard(path("second.h5"), "second", 7, 40);
    config_.network.initial = path("initial");
    config_.network.smal_asset = path("asset");
    config_.network.priors = testing::parity_dir() / "weights_A.safetensors";
    config_.network.device = "cpu";
    config_.network.compute_threads = 1;
    const PoolConfig first{"first", {path("first.h5").string()}, 1.0};
    const PoolConfig second{"second", {path("second.h5").string()}, 0.15};
    config_.phases = {{"warm-up", Objective::prima, {}, {first}, 3, 2, true, 1e-3, 1, Decay::linear},
                      {"joint", Objective::prima, {}, {first, second}, 3, 1, false, 1e-3, 0, Decay::linear}};
    config_.feed.batch = 2;
    config_.seed = 17;
    config_.checkpoint_every = 2;
    config_.log_every = 1;
  }

  std::filesystem::path path(const std::string& name) const { return scratch_.path() / name; }

  TrainingSummary run(const std::string& out, std::int64_t max_steps = 0, int threads = 1) const {
    return train(config_, {path(out), threads, max_steps, /*quiet=*/true});
  }

  static std::string message(const std::function<void()>& call) {
    try {
      call();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "nothing thrown";
  }

  static void flip_bit(const std::filesystem::path& file, std::size_t at) {
    std::string content = manifests::read_file(file);
    content.at(at) ^= 4;
    manifests::write_file_atomically(file, content);
  }

  // A dataset with one shard for each sample of `counts`, and a run on it alone. Returns the shards.
  std::vector<std::filesystem::path> train_on_dataset(const std::vector<int>& counts) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    std::vector<std::filesystem::path> shards;
    std::filesystem::create_directories(path("set/shards"));
    for (std::size_t i = 0; i < counts.size(); ++i) {
      const std::string name = "shards/00000" + std::to_string(i) + ".h5";
      shards.push_back(path("set/" + name));
      testing::write_sample_shard(shards.back(), "shard" + std::to_string(i), counts[i],
                                  20 * static_cast<unsigned>(i + 1));
      list.push_back({{"file", name}, {"sha256", manifests::sha256_file(shards.back())}});
    }
    manifests::write_file_atomically(
        path("set/dataset.json"),
        manifests::seal_json({{"format", "quadruped3d-dataset"}, {"schema", 2}, {"shards", list}}));
    train_on(path("set").string());
    return shards;
  }

  void train_on(const std::string& source) {
    config_.phases = {
        {"only", Objective::prima, {}, {{"set", {source}, 1.0}}, 2, 1, false, 1e-3, 0, Decay::none}};
  }

  TrainingSummary run_without_damage(const std::string& out) const {
    return train(config_, {.out = path(out), .threads = 1, .quiet = true, .skip_damaged = true});
  }

  testing::ScratchDir scratch_;
  TrainingConfig config_;
};

}  // namespace q3d::pipeline::training
