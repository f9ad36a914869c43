// Trains a network from shards: all phases of a stage, resumable at any step. Paper section "Model training".
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/training/settings/training_config.h"

namespace q3d::pipeline::training {

struct TrainingOptions {
  std::filesystem::path out;
  int threads = 0;             // threads that prepare batches; 0 = all cores. Changes no bit
  std::int64_t max_steps = 0;  // of this call; then the state is saved and train() returns. 0 = no limit
  bool quiet = false;
  bool skip_damaged = false;  // leave out damaged shards and records, and name them
};

struct TrainingSummary {
  std::int64_t steps_done = 0;  // steps of all phases, including earlier processes
  std::int64_t steps_total = 0;
  bool finished = false;
  std::int64_t steps_here = 0;  // steps of this call
  double seconds = 0.0;
  double last_loss = 0.0;             // loss of this call's last step
  std::filesystem::path model;        // the weights, once finished
  int rank = 0;                       // of this process; rank 0 reports
  std::vector<std::string> left_out;  // damaged shards and records, one a line, with the reason
};

// Writes into `out`:
//   state.safetensors   the newest state: weights under their official names, optimisers, position. Replaced
//                       as a whole; usable as a checkpoint.
//   log.jsonl           see docs/training.md
//   model.safetensors   the weights alone, when the last phase is done
// A run that was stopped or killed continues from the newest state. It ends with the same weights as an
// uninterrupted run, given the same device, compute threads and number of ranks.
//
// Under a launcher of several ranks (model/ranks/rank_place.h), each rank calls this and trains on its part
// of every batch. Rank 0 alone writes, into a folder that all can read. Throws ConfigError if `out` holds
// another configuration's run or the ranks do not fit each other. Throws Interrupted on Ctrl-C, after saving
// the state. Throws std::runtime_error if another rank is gone, and, naming the batch's sample ids, if loss
// or gradient are not finite or the loss diverges; the newest state then stays unchanged. Throws
// std::runtime_error naming every damaged shard and record (TrainingPools), or the damaged state.
TrainingSummary train(const settings::TrainingConfig& config, const TrainingOptions& options);

}  // namespace q3d::pipeline::training
