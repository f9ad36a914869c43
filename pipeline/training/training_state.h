// Saves and loads the state of a training run.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "model/learner.h"
#include "pipeline/training/loss_watch.h"
#include "smal/tensors/safetensors.h"

namespace q3d::pipeline::training {

struct TrainingPosition {
  int phase = 0;          // the phase that is being trained; the number of phases when all are done
  std::int64_t step = 0;  // steps done in it; the feed's position is step * batch
  LossWatch watch;
};

struct StoredState {
  smal::tensors::SafeTensors file;
  TrainingPosition position;
};

// Saves the state. `key` identifies the run's configuration.
void save_state(const std::filesystem::path& path, const model::Learner& learner,
                const TrainingPosition& position, const std::string& key);

// Loads the state. Returns nothing if there is no file. Compares the file with the digest that it holds; a
// state of an earlier version has none, and a warning says so. Throws ConfigError if it belongs to another
// key, and std::runtime_error if it is damaged.
std::optional<StoredState> load_state(const std::filesystem::path& path, const std::string& key);

}  // namespace q3d::pipeline::training
