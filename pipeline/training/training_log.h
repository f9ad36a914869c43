// The log of a training run, with one JSON object on each line. docs/training.md describes it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "manifests/file_descriptor.h"

namespace q3d::pipeline::training {

struct LogLine {
  int phase = 0;
  std::string phase_name;
  std::int64_t step = 0;  // steps done in the phase
  double loss = 0.0;
  double gradient_norm = 0.0;
  double learning_rate = 0.0;
  double samples_per_second = 0.0;
  double seconds = 0.0;  // time since this process began to train
  std::vector<std::pair<std::string, double>> terms;
};

class TrainingLog {
 public:
  // Keeps the lines of an earlier process up to (phase, step), so that steps which are repeated appear once.
  // Throws manifests::IoError, as all members do.
  TrainingLog(std::filesystem::path path, int phase, std::int64_t step);
  void write(const LogLine& line);
  void sync() const;  // waits until the lines have reached the disk

 private:
  std::filesystem::path path_;
  manifests::FileDescriptor file_;
};

}  // namespace q3d::pipeline::training
