// Evaluations that tests make by hand.
#pragma once

#include <string>

#include "pipeline/evaluation/evaluate.h"

namespace q3d::pipeline::evaluation::testing {

inline SampleResult sample(const std::string& id, manifests::Family family, std::optional<double> auc,
                           std::optional<double> pa_mpjpe = std::nullopt) {
  SampleResult result;
  result.id = "d/test/" + id;
  result.family = family;
  result.normalised_by_mask = true;
  result.values.resize(1);
  result.values[0][index_of(Metric::auc)] = auc;
  result.values[0][index_of(Metric::pa_mpjpe)] = pa_mpjpe;
  result.betas.resize(1);
  return result;
}

inline SampleResult failed(const std::string& id) {
  SampleResult result;
  result.id = "d/test/" + id;
  result.failure = manifests::Reason::image_missing;
  result.detail = "it is not there";
  return result;
}

inline Evaluation evaluation_of(std::vector<SampleResult> samples) {
  Evaluation evaluation;
  evaluation.checkpoint = "model.safetensors";
  evaluation.checkpoint_sha256 = std::string(64, 'c');
  evaluation.settings = {{"prediction", false, 0, 1.0}};
  DatasetResult dataset;
  dataset.name = "d/test";
  dataset.annotations_sha256 = std::string(64, 'a');
  dataset.listed = static_cast<std::int64_t>(samples.size());
  dataset.samples = std::move(samples);
  evaluation.datasets.push_back(std::move(dataset));
  return evaluation;
}

}  // namespace q3d::pipeline::evaluation::testing
