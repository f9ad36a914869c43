// Makes predictions.json, which holds the bodies that `predict` found. docs/predict.md describes the fields.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/prediction/predict_run.h"

namespace q3d::pipeline::prediction {

inline constexpr int kPredictionsSchema = 1;

// Returns the document, with one entry for each animal, in order. Positions are in pixels of the picture, so
// that a reader does not need to know the network's crop.
nlohmann::ordered_json predictions_document(const PredictionSummary& summary);

}  // namespace q3d::pipeline::prediction
