// The log of a training run: one JSON object a line. docs/training.md describes it.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace q3d::pipeline::training {

struct LogLine {
  int phase = 0;
  std::string phase_name;
  std::int64_t step = 0;  // steps done in the phase
  double loss = 0.0;
  double gradient_norm = 0.0;
  double learning_rate = 0.0;
  double samples_per_second = 0.0;
  double seconds = 0.0;  // since this process began to train
  std::vector<std::pair<std::string, double>> terms;
};

class TrainingLog {
 public:
  // Keeps the lines of an earlier process up to (phase, step), so that steps which are repeated appear once.
  // Throws std::runtime_error naming the path and the system's reason.
  TrainingLog(std::filesystem::path path, int phase, std::int64_t step);
  void write(const LogLine& line);

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::filesystem::path path_;
  std::unique_ptr<std::FILE, Close> file_;
};

}  // namespace q3d::pipeline::training
