// predictions.json: the bodies that `predict` found. docs/predict.md describes the fields.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/prediction/predict_run.h"

namespace q3d::pipeline::prediction {

inline constexpr int kPredictionsSchema = 1;

// The document, with one entry an animal in their order. Positions are given in pixels of the picture, so
// that no reader has to know the network's crop.
nlohmann::ordered_json predictions_document(const PredictionSummary& summary);

}  // namespace q3d::pipeline::prediction
