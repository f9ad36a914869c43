// `compare`: tests whether one network is better than another on the same pictures. It uses a paired
// bootstrap over pictures and, if several pairs of evaluations (seeds) are given, over pairs.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "filters/bootstrap.h"
#include "pipeline/evaluation/difference.h"
#include "pipeline/evaluation/evaluation_files.h"

namespace q3d::pipeline::evaluation {

struct CompareOptions {
  filters::BootstrapOptions bootstrap;
  // The two settings that are compared. If they are empty, each setting that all evaluations have is compared
  // with itself.
  std::string before_setting;
  std::string after_setting;
};

// The means are taken over samples and pairs.
struct ComparisonRow : ComparedMeans {
  std::string dataset;
  std::string before_setting;
  std::string after_setting;
  std::int64_t samples = 0;   // samples with a value in every evaluation
  std::int64_t unpaired = 0;  // samples with a value in only some evaluations, which are left out
  std::int64_t pictures = 0;
};

struct Comparison {
  std::size_t pairs = 0;
  CompareOptions options;
  std::vector<ComparisonRow> rows;
  std::vector<std::string> notes;  // what could not be compared
};

// before[i] and after[i] are a pair. A difference counts as better or worse if its interval excludes 0.
// Throws std::invalid_argument if the lists have different lengths or a setting does not exist, and
// std::runtime_error if two evaluations of one dataset differ in annotations, truth or normaliser, or have
// nothing in common.
Comparison compare(const std::vector<StoredEvaluation>& before, const std::vector<StoredEvaluation>& after,
                   const CompareOptions& options);

nlohmann::ordered_json to_json(const Comparison& comparison, const std::vector<StoredEvaluation>& before,
                               const std::vector<StoredEvaluation>& after);
std::string summary_text(const Comparison& comparison);

}  // namespace q3d::pipeline::evaluation
