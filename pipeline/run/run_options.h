// Every run over an output folder takes these options beside its configuration.
#pragma once

#include <filesystem>

namespace q3d::pipeline::run {

struct RunOptions {
  std::filesystem::path out;
  int threads = 0;     // threads of the flow graph; 0 = all cores. Never changes a byte of the result.
  bool quiet = false;  // no progress on stderr
  bool above_ceiling = false;  // allow a tau_high above filter.tau_ceiling
  // Takes every unit through the stages, also those of a dataset that is up to date, and leaves `latest`
  // unchanged.
  bool rebuild = false;
  bool shares_units = false;  // share with the ranks that torchrun or srun has started, if any
};

}  // namespace q3d::pipeline::run
