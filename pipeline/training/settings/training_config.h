// The configuration of a training run: one JSON file, or several laid over each other. docs/training.md
// explains every key.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "model/settings/loss_weights.h"
#include "pipeline/feed/feed.h"
#include "pipeline/training/settings/training_words.h"

namespace q3d::pipeline::training::settings {

struct TrainingNetworkConfig {
  std::filesystem::path initial;   // checkpoint from which training starts
  std::filesystem::path encoders;  // checkpoint whose two image encoders replace those of `initial`; or empty
  std::filesystem::path smal_asset;  // safetensors
  std::filesystem::path priors;      // safetensors with pose_prior_loss.* and shape_prior_loss.*
  std::vector<std::string> without;  // ablations: bio_features, initial_betas, keypoint_tokens
  std::string device = "auto";
  Precision precision = Precision::float32;
  int compute_threads = 0;  // 0 = all cores; can change the last bits
  bool recompute = false;   // the ViT's blocks in the backward pass; never changes a bit
};

struct PoolConfig {
  std::string name;
  std::vector<std::string> shards;  // paths of files and folders
  double weight = 1.0;              // weight of each sample
};

// A phase of training with its own pools, rounds, optimiser and learning rate.
struct PhaseConfig {
  std::string name;
  Objective objective = Objective::prima;
  std::vector<std::string> pool_names;
  std::vector<PoolConfig> pools;  // those of pool_names
  int steps = 0;
  int ief_iterations = 1;
  bool adversarial = false;
  double learning_rate = 3.75e-6;
  int warm_up_steps = 0;
  Decay decay = Decay::linear;
};

// The statement of the finished weights about the pictures that they know (pipeline/device/domain.h).
struct DomainConfig {
  std::string pictures;    // "photographs" or "rendered"; empty says nothing
  std::string trained_on;  // for people
  std::string held_out;    // name of the pool on which L_proj is measured; empty measures nothing
  PoolConfig held_out_pool;
  int samples = 500;  // draws from that pool
};

struct TrainingConfig {
  TrainingNetworkConfig network;
  std::vector<PhaseConfig> phases;  // of the chosen stage
  feed::FeedOptions feed;
  int batch_parts = 1;  // of a rank's samples of a batch, computed one after the other
  int feed_ahead = 2;   // batches prepared in the background
  DomainConfig domain;
  model::settings::LossWeights loss_weights;
  model::settings::LossVariant loss_variant = model::settings::LossVariant::sound;
  double backbone_rate = 0.1;  // factor of the learning rate, in phases with the objective "prima"
  double stem_rate = 1.0;      // of the rate of the encoder that an EfficientNet stem belongs to
  int frozen_stem_blocks = 0;  // of an EfficientNet stem: the first convolution and so many blocks; 0 = none
  double weight_decay = 1e-4;
  double largest_gradient_norm = 0.0;  // 0 = no clipping
  double divergence_factor = 20.0;     // a loss above this times its running mean stops the run
  ModelDtype model_dtype = ModelDtype::float32;
  std::uint64_t seed = 0;
  int checkpoint_every = 500;  // steps
  int log_every = 10;          // steps
};

// Reads the files in order; a later file's keys replace an earlier one's. Relative paths are relative to the
// file that names them. Keeps the phases of `stage` ("1", "3"). `settings` are single keys on top of the
// files (pipeline/config/config_override.h). Throws ConfigError that names file and key, what was found and
// what was expected.
TrainingConfig load_training_config(const std::vector<std::filesystem::path>& files, const std::string& stage,
                                    const std::vector<std::string>& settings = {});

// Checks and converts merged JSON; `where` names it in messages.
TrainingConfig parse_training_config(const nlohmann::json& merged, const std::string& where,
                                     const std::string& stage);

// Returns the effective values that decide the trained weights, as one JSON document. Defaults are filled in,
// so that a default that changes in a later version is noticed. Paths are left out, because the digests of
// their files decide. Keys that only steer the run (device, threads, how often it saves and logs) are left
// out too.
nlohmann::json deciding_values(const TrainingConfig& config);

}  // namespace q3d::pipeline::training::settings
