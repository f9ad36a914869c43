#include "pipeline/derived/derived_manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "manifests/csv.h"
#include "manifests/enumerators.h"
#include "manifests/trust.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::derived {
namespace {

using dataset::Counts;
using dataset::VerdictRow;
using nlohmann::ordered_json;

ordered_json to_json(const Counts& counts) {
  return {{"candidates", counts.candidates},
          {"retained", counts.retained},
          {"refined", counts.refined},
          {"discarded", counts.discarded},
          {"failed", counts.failed}};
}

struct Mean {  // mean of the errors that were computed
  double sum = 0.0;
  std::int64_t count = 0;
  void add(double error) {
    if (std::isnan(error)) return;
    sum += error;
    ++count;
  }
};

struct Group {
  Counts counts;
  Mean initial;
  Mean final;
  void add(const manifests::Judgement& judgement) {
    counts.add(judgement.verdict);
    if (!manifests::is_kept(judgement.verdict)) return;
    initial.add(judgement.initial_error);
    final.add(judgement.final_error);
  }
};
using Groups = std::map<std::string, Group>;

ordered_json to_json(const Group& group) {
  ordered_json entry = to_json(group.counts);
  const auto mean = [&](const char* key, const Mean& errors) {
    if (errors.count > 0) entry[key] = errors.sum / static_cast<double>(errors.count);
  };
  mean("mean_initial_error_of_kept", group.initial);
  mean("mean_final_error_of_kept", group.final);
  return entry;
}

ordered_json to_json(const Groups& groups) {
  ordered_json object = ordered_json::object();
  for (const auto& [name, group] : groups) object[name] = to_json(group);
  return object;
}

// Adds source[key]'s members to target[key]; a member that both have must be equal.
void unite(ordered_json& target, const ordered_json& source, const std::string& what) {
  if (!source.is_object()) return;
  for (const auto& [name, value] : source.items()) {
    const auto found = target.find(name);
    if (found != target.end() && *found != value) {
      throw run::ConfigError(
          fmt::format("the versions have different {} of {}: {} and {}; build one of them with another name "
                      "of the dataset",
                      what, name, found->dump(), value.dump()));
    }
    target[name] = value;
  }
}

// Adds the digests of annotation files. If the sources read different files for a dataset, its digest is
// null; provenance.derived has all of them.
void add_annotations(ordered_json& target, const ordered_json& source) {
  for (const auto& [name, digest] : source.items()) {
    const bool differs = target.contains(name) && target.at(name) != digest;
    target[name] = differs ? ordered_json() : digest;
  }
}

// Returns the value that all sources share, or null.
ordered_json common(const std::vector<ordered_json>& documents, const char* key) {
  const ordered_json first = documents.front().at("provenance").value(key, ordered_json());
  const bool is_common = std::all_of(documents.begin(), documents.end(), [&](const ordered_json& document) {
    return document.at("provenance").value(key, ordered_json()) == first;
  });
  return is_common ? first : ordered_json();
}

ordered_json statistics(const std::vector<Selection>& selections) {
  Group all;
  Groups by_dataset;
  Groups by_family;
  Groups by_species;
  std::map<std::string, std::int64_t> reasons;
  for (const Selection& selection : selections) {
    for (const VerdictRow& row : selection.rows) {
      all.add(row.judgement);
      by_dataset[row.dataset + "/" + row.split].add(row.judgement);
      by_family[std::string(manifests::to_string(row.family))].add(row.judgement);
      by_species[row.species.empty() ? "unknown" : row.species].add(row.judgement);
      if (row.judgement.reason != manifests::Reason::none) {
        ++reasons[std::string(manifests::to_string(row.judgement.reason))];
      }
    }
  }
  return {{"all", to_json(all)},
          {"reasons", reasons},
          {"by_dataset", to_json(by_dataset)},
          {"by_family", to_json(by_family)},
          {"by_species", to_json(by_species)}};
}

ordered_json labels(const std::vector<Selection>& selections) {
  using manifests::LabelKind;
  std::map<LabelKind, std::int64_t> counts;
  for (const Selection& selection : selections) {
    for (const VerdictRow& row : selection.rows) {
      if (const auto kind = selection.dataset.label_kind(row)) ++counts[*kind];
    }
  }
  ordered_json object = ordered_json::object();
  for (const LabelKind kind :
       {LabelKind::truth, LabelKind::retained, LabelKind::refined, LabelKind::two_d_only}) {
    object[std::string(manifests::to_string(kind))] = counts[kind];
  }
  return object;
}

// Returns the terms of the datasets, also for versions of schema 1, which state none.
ordered_json datasets_of(const Selection& selection, const ordered_json& document) {
  if (document.contains("datasets")) return document.at("datasets");
  ordered_json datasets = ordered_json::object();
  for (const auto& [name, role] : selection.dataset.manifest().roles) {
    datasets[name] = {
        {"role", config::to_string(role)}, {"licence", ""}, {"source_url", ""}, {"citation", ""}};
  }
  return datasets;
}

// Returns the datasets of all sources' configs, each once.
ordered_json united_config(const std::vector<Selection>& selections,
                           const std::vector<ordered_json>& documents) {
  ordered_json datasets = ordered_json::array();
  std::size_t unit_size = 0;
  for (std::size_t i = 0; i < documents.size(); ++i) {
    for (const ordered_json& own : documents[i].at("provenance").at("config").at("datasets")) {
      const bool is_there = std::any_of(datasets.begin(), datasets.end(), [&](const ordered_json& each) {
        return each.at("name") == own.at("name") &&
               each.value("split", "train") == own.value("split", "train");
      });
      if (!is_there) datasets.push_back(own);
    }
    unit_size = std::max(unit_size, selections[i].dataset.manifest().unit_size);
  }
  return {{"datasets", datasets}, {"shards", {{"unit_size", unit_size}}}};
}

std::string number(double value) {
  return std::isnan(value) ? std::string() : fmt::format("{}", value);
}

std::string line_of(const VerdictRow& row) {
  const manifests::Judgement& judgement = row.judgement;
  const bool judged = row.is_judged();
  manifests::CsvRow cells{row.id,
                          std::string(manifests::to_string(judgement.verdict)),
                          std::string(manifests::to_string(judgement.reason)),
                          number(judgement.initial_error),
                          number(judgement.final_error),
                          number(judgement.gain),
                          judged ? std::to_string(judgement.iterations) : "",
                          judged ? std::to_string(judgement.best_iteration) : ""};
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) {
    cells.push_back(number(judgement.trust.*column.score));
  }
  for (const std::string& text :
       {row.dataset, row.split, row.source, row.species, std::string(manifests::to_string(row.family))}) {
    cells.push_back(text);
  }
  cells.push_back(row.label ? std::to_string(row.label->shard) : "");
  cells.push_back(row.label ? std::to_string(row.label->row) : "");
  cells.push_back(row.image_sha256);
  cells.push_back(judgement.detail);
  return manifests::csv_line(cells);
}

}  // namespace

ordered_json derived_manifest(const std::vector<Selection>& selections, const ordered_json& how) {
  std::vector<ordered_json> documents;
  ordered_json datasets = ordered_json::object();
  ordered_json thresholds = ordered_json::object();
  ordered_json annotations = ordered_json::object();
  ordered_json from = ordered_json::array();
  Counts counts;
  for (const Selection& selection : selections) {
    const ordered_json& document =
        documents.emplace_back(dataset::read_dataset_document(selection.dataset.folder()));
    unite(datasets, datasets_of(selection, document), "roles or terms");
    unite(thresholds, document.at("thresholds"), "thresholds");
    add_annotations(annotations, document.at("provenance").value("annotations", ordered_json::object()));
    from.push_back({{"folder", selection.dataset.version_name()},
                    {"name", document.at("name")},
                    {"version", document.at("version")},
                    {"key", document.at("key")},
                    {"content_id", document.at("content_id")},
                    {"toolkit", document.at("toolkit")},
                    {"provenance", document.at("provenance")}});
    for (const VerdictRow& row : selection.rows) counts.add(row.judgement.verdict);
  }
  const bool is_one_profile =
      std::all_of(documents.begin(), documents.end(), [&](const ordered_json& document) {
        return document.at("profile") == documents.front().at("profile");
      });
  return {{"format", dataset::kDatasetFormat},
          {"schema", manifests::kShardSchema},
          {"name", ""},
          {"version", ""},
          {"key", ""},
          {"content_id", ""},
          {"toolkit", run::version()},
          {"counts", to_json(counts)},
          {"labels", labels(selections)},
          {"datasets", datasets},
          {"profile", is_one_profile ? documents.front().at("profile") : ordered_json("mixed")},
          {"thresholds", thresholds.empty() ? ordered_json() : thresholds},
          {"guards", ordered_json()},
          {"statistics", statistics(selections)},
          {"provenance",
           {{"config", united_config(selections, documents)},
            {"annotations", annotations},
            {"veto", nullptr},
            {"leakage", nullptr},
            {"checkpoint_sha256", common(documents, "checkpoint_sha256")},
            {"smal_asset_sha256", common(documents, "smal_asset_sha256")},
            {"priors_sha256", common(documents, "priors_sha256")},
            {"device", common(documents, "device")},
            // No stage's folder belongs to this version.
            {"stage_keys",
             {{"ingest", nullptr},
              {"predict", nullptr},
              {"fidelity", nullptr},
              {"refine", nullptr},
              {"measure", nullptr},
              {"shards", nullptr}}},
            {"derived", {{"how", how}, {"from", from}}}}}};
}

std::string derived_verdicts(const std::vector<Selection>& selections) {
  std::string text = "id,verdict,reason,initial_error,final_error,gain,iterations,best_iteration";
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) text.append(",").append(column.name);
  text += ",dataset,split,source,species,family,shard,row,image_sha256,detail\n";
  for (const Selection& selection : selections) {
    for (const VerdictRow& row : selection.rows) text += line_of(row);
  }
  return text;
}

}  // namespace q3d::pipeline::derived
