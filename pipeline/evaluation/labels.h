// `evaluate-labels`: measures the accuracy of the labels of a build, for pools whose truth is known.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/build/build.h"
#include "pipeline/evaluation/judged_candidates.h"
#include "pipeline/evaluation/metric.h"

namespace q3d::pipeline::evaluation {

// The measurements of one body of a candidate.
struct MeasuredBody {
  MetricValues annotated;  // 2D against the annotated keypoints, which adaptation saw; 3D against the truth
  MetricValues projected;  // 2D alone, against the true body's projections inside the picture, hidden or not
};

struct MeasuredCandidate {
  std::string id;
  manifests::Verdict verdict = manifests::Verdict::failed;
  manifests::Reason reason = manifests::Reason::none;
  bool normalised_by_mask = false;
  bool has_truth = false;
  MeasuredBody predicted;             // before refinement
  std::optional<MeasuredBody> label;  // set for kept candidates
};

// A group of candidates, measured by their labels or by the predictions from which these came.
struct LabelRow {
  std::string group;   // "pool", "kept", "retained", "refined", "discarded", and the discarded by reason
  std::string bodies;  // "label" or "prediction"
  std::int64_t samples = 0;
  std::int64_t by_mask = 0;
  std::array<MetricMean, kMetricCount> annotated;
  std::array<MetricMean, kMetricCount> projected;
};

struct LabelEvaluation {
  std::string dataset;  // the version's name
  std::string content_id;
  std::vector<std::string> truth_sha256;
  std::int64_t failed = 0;         // candidates without a prediction
  std::int64_t without_truth = 0;  // of the measured
  std::vector<MeasuredCandidate> candidates;
  std::vector<LabelRow> rows;
};

struct LabelOptions {
  run::RunOptions run;                       // run.out is the output folder of the build
  std::vector<std::filesystem::path> truth;  // hidden truth of the pool; if empty, the records' own
  std::filesystem::path masks;               // base folder of its mask paths; if empty, masks are not used
};

// Measures the dataset that was built with `config` in options.run.out. Everything is read from that folder.
// No picture is read, and annotation files are read only if the truth files lack a body or a mask. Throws
// ConfigError, std::runtime_error, Interrupted.
LabelEvaluation evaluate_labels(const config::BuildConfig& config, const LabelOptions& options);

// Returns the rows of the groups that occur.
std::vector<LabelRow> group_labels(const std::vector<MeasuredCandidate>& candidates);

nlohmann::ordered_json to_json(const LabelEvaluation& evaluation);
std::string labels_csv(const LabelEvaluation& evaluation);  // one line for each candidate
std::string summary_text(const LabelEvaluation& evaluation);

// Writes labels.csv and, last, labels.json, each completely or not at all. Throws std::runtime_error.
void write_label_evaluation(const std::filesystem::path& folder, const LabelEvaluation& evaluation);

}  // namespace q3d::pipeline::evaluation
