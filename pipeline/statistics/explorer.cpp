#include "pipeline/statistics/explorer.h"

#include <cmath>
#include <map>

#include "manifests/enumerators.h"
#include "pipeline/config/build_config.h"
#include "pipeline/statistics/numbers.h"

namespace q3d::pipeline::statistics {
namespace {

using manifests::Reason;
using nlohmann::ordered_json;

// Numbers names in the order of first use.
class Names {
 public:
  std::size_t number(const std::string& name) {
    const auto [entry, is_new] = numbers_.emplace(name, numbers_.size());
    if (is_new) names_.push_back(name);
    return entry->second;
  }
  ordered_json json() const { return names_; }

 private:
  std::map<std::string, std::size_t> numbers_;
  std::vector<std::string> names_;
};

std::string species_of(const dataset::VerdictRow& row) {
  return row.species.empty() ? "unknown" : row.species;
}

// Returns whether a candidate with this reason stays out whatever the thresholds are.
bool is_fixed(Reason reason) {
  return reason == Reason::vetoed || reason == Reason::in_test_split || reason == Reason::too_few_keypoints;
}

// Returns whether any guard is on. A guard is on if one of its numbers is not 0; `held_out_seed` alone has no
// effect, and candidates below `visible_min` are fixed anyway (is_fixed).
bool is_guarded(const ordered_json& document) {
  if (!document.contains("guards") || !document["guards"].is_object()) return false;
  for (const auto& [name, value] : document["guards"].items()) {
    if (name != "held_out_seed" && name != "visible_min" && value.is_number() && value.get<double>() != 0.0) {
      return true;
    }
  }
  return false;
}

// Returns whether thresholds decide about the candidate, because the fidelity rule judged its prediction.
bool is_open(const CandidateFacts& candidate) {
  return candidate.role == config::Role::pseudo && candidate.row.is_judged() &&
         candidate.row.judgement.verdict != manifests::Verdict::failed;
}

ordered_json rule_json(const ordered_json& document) {
  const ordered_json& config = document.at("provenance").at("config");
  const ordered_json tta = config.contains("tta") ? config["tta"] : ordered_json::object();
  const config::TtaConfig defaults;
  const ordered_json filter = config.contains("filter") ? config["filter"] : ordered_json::object();
  return {{"iterations_min", tta.value("iterations_min", defaults.iterations_min)},
          {"iterations_max", tta.value("iterations_max", defaults.iterations_max)},
          {"gain_window", filters::Thresholds{}.gain_window},
          {"refine_retained", tta.value("refine_retained", defaults.refine_retained)},
          {"min_trust", filter.value("min_trust", 0.0)},
          {"guarded", is_guarded(document)}};
}

ordered_json thresholds_json(const dataset::DatasetManifest& manifest) {
  ordered_json object = ordered_json::object();
  for (const auto& [name, each] : manifest.thresholds) {
    object[name] = {{"tau_low", each.tau_low}, {"tau_high", each.tau_high}, {"delta", each.delta}};
  }
  return object;
}

}  // namespace

ordered_json explorer(const Facts& facts, const dataset::DatasetManifest& manifest,
                      const ordered_json& document) {
  Names datasets, species;
  std::map<std::string, std::pair<std::int64_t, std::int64_t>> others;  // candidates and kept ones
  ordered_json columns = ordered_json::object();
  bool has_trust = false;
  constexpr const char* kColumns[] = {"dataset",    "group",          "error",      "gain",
                                      "iterations", "best_iteration", "auc_before", "auc_after",
                                      "kept",       "fixed",          "trust"};
  for (const char* name : kColumns) columns[name] = ordered_json::array();
  for (const CandidateFacts& candidate : facts.candidates) {
    const manifests::Judgement& judgement = candidate.row.judgement;
    const bool is_kept = manifests::is_kept(judgement.verdict);
    if (!is_open(candidate)) {
      auto& [count, kept] = others[species_of(candidate.row)];
      ++count;
      kept += is_kept;
      continue;
    }
    const bool is_adapted = judgement.iterations > 0;
    columns["dataset"].push_back(datasets.number(candidate.row.dataset));
    columns["group"].push_back(species.number(species_of(candidate.row)));
    columns["error"].push_back(judgement.initial_error);
    columns["gain"].push_back(is_adapted && std::isfinite(judgement.gain) ? ordered_json(judgement.gain)
                                                                          : ordered_json(nullptr));
    columns["iterations"].push_back(judgement.iterations);
    columns["best_iteration"].push_back(judgement.best_iteration);
    columns["auc_before"].push_back(candidate.prediction ? rounded(100.0 * candidate.prediction->auc)
                                                         : ordered_json(nullptr));
    columns["auc_after"].push_back(candidate.label ? rounded(100.0 * candidate.label->auc)
                                                   : ordered_json(nullptr));
    columns["kept"].push_back(is_kept ? 1 : 0);
    columns["fixed"].push_back(is_fixed(judgement.reason) ? 1 : 0);
    columns["trust"].push_back(rounded(judgement.trust.combined, 6));
    has_trust = has_trust || std::isfinite(judgement.trust.combined);
  }
  if (columns["error"].empty()) return nullptr;
  if (!has_trust) columns.erase("trust");
  ordered_json rest = ordered_json::object();
  for (const auto& [name, counts] : others) rest[name] = {counts.first, counts.second};
  ordered_json object = {{"thresholds", thresholds_json(manifest)}, {"rule", rule_json(document)}};
  object["datasets"] = datasets.json();
  object["species"] = species.json();
  object.update(columns);
  object["others"] = std::move(rest);
  return object;
}

}  // namespace q3d::pipeline::statistics
