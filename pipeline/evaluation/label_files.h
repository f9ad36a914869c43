// Reads the results that `evaluate-labels --report` wrote.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/evaluation/metric.h"

namespace q3d::pipeline::evaluation {

struct StoredLabel {
  std::string id;
  bool kept = false;
  MetricValues values;  // label against annotated keypoints and true body; empty unless kept
};

struct StoredLabels {
  std::string folder;
  std::string dataset;  // the version's name
  std::string content_id;
  std::vector<std::string> truth_sha256;
  std::vector<StoredLabel> candidates;
};

// Reads labels.json and labels.csv of a folder. Throws std::runtime_error naming the file.
StoredLabels read_label_evaluation(const std::filesystem::path& folder);

}  // namespace q3d::pipeline::evaluation
