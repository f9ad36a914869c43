// Candidates for the tests of statistics, made by hand.
#pragma once

#include <limits>
#include <string>

#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

struct Made {
  std::string species = "lion";
  manifests::Family family = manifests::Family::felidae;
  manifests::Verdict verdict = manifests::Verdict::retained;
  manifests::Reason reason = manifests::Reason::none;
  double initial_error = 0.02;
  double final_error = 0.02;
  double gain = std::numeric_limits<double>::quiet_NaN();
  int iterations = 0;
};

inline CandidateFacts candidate(const Made& made) {
  CandidateFacts facts;
  facts.row.dataset = "zoo";
  facts.row.split = "train";
  facts.row.species = made.species;
  facts.row.family = made.family;
  facts.row.judgement.verdict = made.verdict;
  facts.row.judgement.reason = made.reason;
  facts.row.judgement.initial_error = made.initial_error;
  facts.row.judgement.final_error = made.final_error;
  facts.row.judgement.gain = made.gain;
  facts.row.judgement.iterations = made.iterations;
  const bool is_kept =
      made.verdict == manifests::Verdict::retained || made.verdict == manifests::Verdict::refined;
  if (is_kept) facts.row.label = dataset::VerdictRow::LabelPlace{};
  return facts;
}

// A fit whose visible keypoints, the first few, lie at these distances.
inline Fit fit(std::initializer_list<float> distances, double auc) {
  Fit result;
  result.distance.fill(std::numeric_limits<float>::quiet_NaN());
  std::copy(distances.begin(), distances.end(), result.distance.begin());
  result.auc = auc;
  return result;
}

}  // namespace q3d::pipeline::statistics
