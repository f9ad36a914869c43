// `evaluate`: measures the paper's metrics of a network on test sets.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "manifests/sample.h"
#include "pipeline/evaluation/evaluation_config.h"
#include "pipeline/evaluation/metric.h"
#include "pipeline/evaluation/setting.h"
#include "pipeline/run/run_options.h"

namespace q3d::pipeline::evaluation {

struct EvaluationOptions {
  SettingOptions settings;
  std::int64_t limit = 0;       // samples of each dataset, evenly spaced; 0 = all
  std::uint64_t seed = 0;       // seed of hidden keypoints and of k-means
  bool official_means = false;  // a sample without a value counts as 0
  run::RunOptions run;          // the folder for the results, threads, progress, ranks
};

using Betas = std::array<float, manifests::kNumBetas>;

struct SampleResult {
  std::string id;
  std::string species;  // empty when unknown
  manifests::Family family = manifests::Family::none;
  manifests::Reason failure = manifests::Reason::none;  // why it is left out of everything
  std::string detail;
  bool normalised_by_mask = false;
  std::optional<Betas> true_betas;
  std::vector<MetricValues> values;  // by setting; empty when it failed
  std::vector<Betas> betas;          // by setting; empty when it failed
};

struct DatasetResult {
  std::string name;  // dataset/split
  std::string annotations_sha256;
  std::string truth_sha256;  // digest of the hidden truth; empty if there is none
  std::int64_t listed = 0;   // samples of the annotation file; `limit` may take fewer
  bool is_rendered = false;  // its pictures come from `sample`
  std::vector<std::string> notes;
  std::vector<SampleResult> samples;
};

struct Evaluation {
  EvaluationOptions options;
  nlohmann::json config;   // as the user wrote it
  std::string checkpoint;  // file name
  std::string checkpoint_sha256;
  std::string smal_asset_sha256;
  std::string device_key;      // the properties of the device that decide the bits
  std::string device;          // for people
  std::string device_warning;  // a GPU that is present but cannot be used, and why; else empty
  std::vector<Setting> settings;
  std::vector<DatasetResult> datasets;
  double seconds = 0.0;
};

// Predicts and, if requested, adapts every sample in batches, and calls `write` in rank 0, alone of all
// ranks, to write the results. A bad sample gives a result with a reason. Until the results are written,
// finished units lie in <out>/.parts; the same evaluation goes on from there if it was stopped. Ranks share
// the units if options.run.shares_units is set. Throws ConfigError, std::runtime_error, Interrupted, and what
// `write` throws.
void evaluate(const EvaluationConfig& config, const EvaluationOptions& options,
              const std::function<void(const Evaluation&)>& write);

}  // namespace q3d::pipeline::evaluation
