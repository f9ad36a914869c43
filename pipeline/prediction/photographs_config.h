// Makes the config of a prediction whose photographs are named on the command line.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"

namespace q3d::pipeline::prediction {

struct PhotographOptions {
  std::filesystem::path boxes;  // a file of boxes (loaders/formats/photographs.cpp); empty: none
  double min_score = 0.2;       // boxes with a lower score are left out; MegaDetector's usual threshold
  std::string species;          // species of all animals; may be empty
};

// Reads the config files and single settings (load_build_config) and replaces their datasets by one,
// "photos", which has the pictures of `folder`. Throws ConfigError as load_build_config does, and without a
// network in the config.
config::BuildConfig photographs_config(const std::filesystem::path& folder, const PhotographOptions& options,
                                       const std::vector<std::filesystem::path>& files,
                                       std::vector<std::string> settings = {});

}  // namespace q3d::pipeline::prediction
