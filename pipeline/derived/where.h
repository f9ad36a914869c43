// Parses conditions on candidates: `species = lion and trust > 0.8`.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "manifests/verdict.h"
#include "pipeline/dataset/verdicts.h"

namespace q3d::pipeline::derived {

// The facts of a candidate that a condition may use: its row of verdicts.csv, and the kind of its label.
struct WhereRow {
  const dataset::VerdictRow& verdict;
  std::optional<manifests::LabelKind> label_kind;  // nothing unless it is kept
};
using Condition = std::function<bool(const WhereRow&)>;

// Reads a condition.
//
//   condition  = and-part { "or" and-part }
//   and-part   = not-part { "and" not-part }
//   not-part   = "not" not-part | "(" condition ")" | field operator value
//   operator   = "=" | "!=" | "<" | "<=" | ">" | ">="
//
// Fields with texts are id, dataset, split, source, species, family, verdict, reason and label_kind, compared
// by = and != alone. Fields with numbers are initial_error, final_error, gain, iterations, best_iteration and
// the trust scores; a number that was not computed fulfils no comparison but !=. A value is one word, or a
// text between double quotes. Throws run::ConfigError that says what was found where, and what was expected.
Condition parse_where(const std::string& text);

}  // namespace q3d::pipeline::derived
