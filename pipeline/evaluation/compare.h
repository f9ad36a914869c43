// `compare`: is one network better than another on the same pictures? A paired bootstrap over pictures and,
// where several pairs of evaluations (seeds) are given, over pairs.
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
  // Settings to set against each other; empty = each setting that all evaluations have, against itself.
  std::string before_setting;
  std::string after_setting;
};

// The means are those over samples and pairs.
struct ComparisonRow : ComparedMeans {
  std::string dataset;
  std::string before_setting;
  std::string after_setting;
  std::int64_t samples = 0;   // with a value in every evaluation
  std::int64_t unpaired = 0;  // with a value in some only, and so left out
  std::int64_t pictures = 0;
};

struct Comparison {
  std::size_t pairs = 0;
  CompareOptions options;
  std::vector<ComparisonRow> rows;
  std::vector<std::string> notes;  // what could not be compared
};

// before[i] and after[i] are a pair. Better or worse: the interval leaves out 0. Throws std::invalid_argument
// when the lists do not pair or a setting is not there, std::runtime_error when two evaluations of one
// dataset differ in annotations, truth or normaliser, or have nothing in common.
Comparison compare(const std::vector<StoredEvaluation>& before, const std::vector<StoredEvaluation>& after,
                   const CompareOptions& options);

nlohmann::ordered_json to_json(const Comparison& comparison, const std::vector<StoredEvaluation>& before,
                               const std::vector<StoredEvaluation>& after);
std::string summary_text(const Comparison& comparison);

}  // namespace q3d::pipeline::evaluation
