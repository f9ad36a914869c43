// The state of a training run on disk.
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

// `key` identifies the configuration that the run belongs to.
void save_state(const std::filesystem::path& path, const model::Learner& learner,
                const TrainingPosition& position, const std::string& key);

// Nothing when there is no file. Compares the file with the digest that it holds; a state of an earlier
// version holds none, and a warning says so. Throws ConfigError when it belongs to another key,
// std::runtime_error when it is damaged.
std::optional<StoredState> load_state(const std::filesystem::path& path, const std::string& key);

}  // namespace q3d::pipeline::training
