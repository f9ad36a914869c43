// Reads the results that `evaluate` wrote, with the values of every sample, for comparisons.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/evaluation/metric.h"

namespace q3d::pipeline::evaluation {

struct StoredSample {
  std::string id;
  std::string normaliser;  // "mask" or "crop"
  MetricValues values;
};

struct StoredDataset {
  std::string annotations_sha256;
  std::string truth_sha256;                                   // empty when there was none
  std::map<std::string, std::vector<StoredSample>> settings;  // by setting's name, in file order
};

struct StoredEvaluation {
  std::string folder;  // as it was given
  std::string checkpoint;
  std::string checkpoint_sha256;
  std::vector<std::string> setting_names;  // in the order in which they were measured
  std::vector<std::string> dataset_names;  // likewise
  std::map<std::string, StoredDataset> datasets;
};

// `path` is the folder that `evaluate` wrote, or its evaluation.json. Throws std::runtime_error that names
// file and place, what was found and what was expected.
StoredEvaluation read_evaluation(const std::filesystem::path& path);

}  // namespace q3d::pipeline::evaluation
