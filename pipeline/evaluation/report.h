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

// Returns all tables, the config, digests, the seed, and the samples that were left out with the reasons. It
// adds no time, host or path, so equal evaluations give equal bytes.
nlohmann::ordered_json to_json(const Evaluation& evaluation, const Tables& tables);

// Returns one line for each sample and setting. A sample that was left out has one line, with the reason and
// no values.
std::string samples_csv(const Evaluation& evaluation);

// Returns all tables, one line for each row.
std::string tables_csv(const Tables& tables);

// Returns the tables aligned for a terminal. There are many species, so they are shown only if requested.
std::string summary_text(const Evaluation& evaluation, const Tables& tables, bool with_species);

// Writes the three files, each completely or not at all, evaluation.json last. Throws std::runtime_error.
void write_evaluation(const std::filesystem::path& folder, const Evaluation& evaluation,
                      const Tables& tables);

}  // namespace q3d::pipeline::evaluation
