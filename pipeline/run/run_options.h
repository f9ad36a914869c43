// Every run over an output folder takes these options beside its configuration.
#pragma once

#include <filesystem>

namespace q3d::pipeline::run {

struct RunOptions {
  std::filesystem::path out;
  int threads = 0;             // of the flow graph; 0 = all cores. Never changes a byte of the result.
  bool quiet = false;          // no progress on stderr
  bool above_ceiling = false;  // go on with a tau_high above filter.tau_ceiling
  // Take every unit through the stages, also those of a dataset that is up to date, and leave `latest` as it
  // is.
  bool rebuild = false;
  bool shares_units = false;  // with the ranks that torchrun or srun has started, if it has
};

}  // namespace q3d::pipeline::run
