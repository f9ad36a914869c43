// Writes the results of `evaluate`: evaluation.json, samples.csv and tables.csv, and a summary for people.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>

#include "pipeline/evaluation/evaluate.h"
#include "pipeline/evaluation/tables.h"

namespace q3d::pipeline::evaluation {

inline constexpr const char* kEvaluationFormat = "quadruped3d-evaluation";
inline constexpr int kEvaluationSchema = 1;

// All tables, the config, digests, seed, and what was left out and why. No time, host or path of its own, so
// equal evaluations give equal bytes.
nlohmann::ordered_json to_json(const Evaluation& evaluation, const Tables& tables);

// One line a sample and setting; a sample that was left out has one line, with the reason and no values.
std::string samples_csv(const Evaluation& evaluation);

// All tables, one line a row.
std::string tables_csv(const Tables& tables);

// Tables aligned for a terminal. Species are many, so they are shown when asked for.
std::string summary_text(const Evaluation& evaluation, const Tables& tables, bool with_species);

// Writes the three files, each whole or not at all, evaluation.json last. Throws std::runtime_error.
void write_evaluation(const std::filesystem::path& folder, const Evaluation& evaluation,
                      const Tables& tables);

}  // namespace q3d::pipeline::evaluation
