// What every run over an output folder is told beside its configuration.
#pragma once

#include <filesystem>

#include "pipeline/run/warn.h"

namespace q3d::pipeline::run {

struct RunOptions {
  std::filesystem::path out;
  int threads = 0;     // of the flow graph; 0 = all cores. Never changes a byte of the result.
  bool quiet = false;  // no progress on stderr
  Warn warn{};         // is told of every damaged file that is made again; may be empty
};

}  // namespace q3d::pipeline::run
