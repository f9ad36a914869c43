#include "pipeline/dataset/dataset_manifest.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cmath>

#include "manifests/csv.h"
#include "manifests/digest.h"
#include "manifests/enumerators.h"
#include "manifests/sealed_json.h"
#include "manifests/shard.h"
#include "pipeline/config/effective_config.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::csv_cell;
using manifests::Verdict;
using nlohmann::ordered_json;

ordered_json counts_json(const Counts& counts) {
  return {{"candidates", counts.candidates},
          {"retained", counts.retained},
          {"refined", counts.refined},
          {"discarded", counts.discarded},
          {"failed", counts.failed}};
}

// Counts and mean errors by any label of the candidates.
class Statistics {
 public:
  void add(const std::string& label, const manifests::Judgement& judgement) {
    Group& group = groups_[label.empty() ? "unknown" : label];
    group.counts.add(judgement.verdict);
    if (manifests::is_kept(judgement.verdict)) {
      group.initial.add(judgement.initial_error);
      group.final.add(judgement.final_error);
    }
  }
  ordered_json to_json() const {
    ordered_json object = ordered_json::object();
    for (const auto& [label, group] : groups_) {
      ordered_json entry = counts_json(group.counts);
      if (group.initial.count > 0) entry["mean_initial_error_of_kept"] = group.initial.mean();
      if (group.final.count > 0) entry["mean_final_error_of_kept"] = group.final.mean();
      object[label] = std::move(entry);
    }
    return object;
  }

 private:
  struct Mean {  // of the errors that were computed
    double sum = 0.0;
    std::int64_t count = 0;
    void add(double error) {
      if (std::isnan(error)) return;
      sum += error;
      ++count;
    }
    double mean() const { return sum / static_cast<double>(count); }
  };
  struct Group {
    Counts counts;
    Mean initial;
    Mean final;
  };
  std::map<std::string, Group> groups_;
};

ordered_json statistics(const candidates::Ingest& ingest,
                        const std::vector<manifests::Judgement>& judgements) {
  Statistics all;
  Statistics by_dataset;
  Statistics by_family;
  Statistics by_species;
  std::map<std::string, std::int64_t> reasons;
  for (std::size_t i = 0; i < judgements.size(); ++i) {
    const manifests::SampleRecord& record = ingest.candidates[i].record;
    all.add("all", judgements[i]);
    by_dataset.add(record.dataset + "/" + record.split, judgements[i]);
    by_family.add(std::string(manifests::to_string(record.family)), judgements[i]);
    by_species.add(record.species, judgements[i]);
    if (judgements[i].reason != manifests::Reason::none) {
      ++reasons[std::string(manifests::to_string(judgements[i].reason))];
    }
  }
  ordered_json object = all.to_json();
  object["reasons"] = reasons;
  object["by_dataset"] = by_dataset.to_json();
  object["by_family"] = by_family.to_json();
  object["by_species"] = by_species.to_json();
  return object;
}

ordered_json count_labels(const candidates::Ingest& ingest,
                          const std::vector<manifests::Judgement>& judgements) {
  using manifests::LabelKind;
  ordered_json labels = ordered_json::object();
  for (const LabelKind kind :
       {LabelKind::truth, LabelKind::retained, LabelKind::refined, LabelKind::two_d_only}) {
    std::int64_t count = 0;
    for (std::size_t i = 0; i < judgements.size(); ++i) {
      count += manifests::is_kept(judgements[i].verdict) &&
               config::label_kind(ingest.candidates[i].role, judgements[i].verdict) == kind;
    }
    labels[std::string(manifests::to_string(kind))] = count;
  }
  return labels;
}

// Those of each dataset with pseudo labels; null where there is none.
ordered_json describe_thresholds(const DatasetInputs& inputs) {
  if (!config::needs_network(*inputs.config)) return nullptr;
  ordered_json datasets = ordered_json::object();
  for (const auto& [name, thresholds] : inputs.rules->thresholds) {
    datasets[name] = {
        {"tau_low", thresholds.tau_low}, {"tau_high", thresholds.tau_high}, {"delta", thresholds.delta}};
  }
  return datasets;
}

// Every guard with its value, 0 = off, without the path of the priors, which `provenance` has a digest of.
ordered_json describe_guards(const DatasetInputs& inputs) {
  if (!config::needs_network(*inputs.config)) return nullptr;
  ordered_json guards = config::effective_guards(inputs.config->guards);
  guards.erase("priors");
  return guards;
}

ordered_json describe_veto(const std::optional<candidates::Veto>& veto) {
  if (!veto) return nullptr;
  return {{"sha256", veto->sha256}, {"ids", veto->reasons.size()}, {"matched", veto->matched}};
}

ordered_json describe_corrections(const std::optional<candidates::Corrections>& corrections) {
  if (!corrections) return nullptr;
  return {{"sha256", corrections->sha256},
          {"ids", corrections->points.size()},
          {"matched", corrections->matched}};
}

ordered_json describe_leakage(const DatasetInputs& inputs) {
  const std::optional<candidates::LeakageSummary>& leakage = inputs.ingest->leakage;
  if (!leakage) return nullptr;
  return {{"test_sets", leakage->test_sets},
          {"test_pictures", leakage->test_pictures},
          {"max_distance", inputs.config->leakage->max_distance},
          {"excluded", leakage->excluded},
          {"pictures_alike_in_pool", leakage->in_groups}};
}

ordered_json text_or_null(const std::string& text) {
  return text.empty() ? ordered_json(nullptr) : ordered_json(text);
}

// Describes where the samples come from, and under which terms.
ordered_json describe_datasets(const config::BuildConfig& config) {
  const auto terms = terms_of_datasets(config);
  ordered_json datasets = ordered_json::object();
  for (const config::DatasetConfig& dataset : config.datasets) {
    const std::string name = dataset.name + "/" + dataset.split;
    const manifests::DatasetTerms& own = terms.at(name);
    datasets[name] = {{"format", dataset.format},
                      {"role", config::to_string(dataset.role)},
                      {"licence", own.licence},
                      {"source_url", own.source_url},
                      {"citation", own.citation}};
  }
  return datasets;
}

// Shortest text that reads back as the same number; empty for NaN.
std::string number(double value) {
  return std::isnan(value) ? std::string() : fmt::format("{}", value);
}

// The cells of the trust scores, each after its comma.
std::string trust_cells(const manifests::TrustScores& trust) {
  std::string cells;
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) {
    cells += "," + number(trust.*column.score);
  }
  return cells;
}

}  // namespace

void Counts::add(Verdict verdict) {
  ++candidates;
  switch (verdict) {
    case Verdict::retained:
      ++retained;
      break;
    case Verdict::refined:
      ++refined;
      break;
    case Verdict::discarded:
      ++discarded;
      break;
    case Verdict::failed:
      ++failed;
      break;
  }
}

std::map<std::string, manifests::DatasetTerms> terms_of_datasets(const config::BuildConfig& config) {
  std::map<std::string, manifests::DatasetTerms> terms;
  for (const config::DatasetConfig& dataset : config.datasets) {
    terms[dataset.name + "/" + dataset.split] = {dataset.licence, dataset.source_url, dataset.citation};
  }
  return terms;
}

std::string content_id(const std::vector<ShardEntry>& shards) {
  std::string text;
  for (const ShardEntry& shard : shards) text += shard.sha256 + '\n';
  return manifests::sha256(text);
}

ordered_json notes_json(const std::vector<candidates::IngestNote>& notes) {
  ordered_json list = ordered_json::array();
  for (const candidates::IngestNote& note : notes) {
    list.push_back({{"kind", loaders::formats::to_string(note.kind)},
                    {"dataset", text_or_null(note.dataset)},
                    {"text", note.text}});
  }
  return list;
}

std::string dataset_json(const DatasetInputs& inputs, const std::vector<manifests::Judgement>& judgements,
                         const std::vector<ShardEntry>& shards, const std::string& verdicts_sha256) {
  Counts counts;
  for (const auto& judgement : judgements) counts.add(judgement.verdict);
  ordered_json shard_list = ordered_json::array();
  for (const ShardEntry& shard : shards) {
    shard_list.push_back({{"file", shard.file},
                          {"unit", shard.unit},
                          {"rows", shard.rows},
                          {"bytes", shard.bytes},
                          {"sha256", shard.sha256}});
  }
  const stages::StageKeys& keys = *inputs.keys;
  const ordered_json document = {{"format", kDatasetFormat},
                                 {"schema", manifests::kShardSchema},
                                 {"name", inputs.config->name},
                                 {"version", inputs.config->version},
                                 {"key", keys.dataset},
                                 {"content_id", content_id(shards)},
                                 {"toolkit", run::version()},
                                 {"counts", counts_json(counts)},
                                 {"labels", count_labels(*inputs.ingest, judgements)},
                                 {"datasets", describe_datasets(*inputs.config)},
                                 {"profile", inputs.config->profile},
                                 {"thresholds", describe_thresholds(inputs)},
                                 {"guards", describe_guards(inputs)},
                                 {"statistics", statistics(*inputs.ingest, judgements)},
                                 {"notes", notes_json(inputs.ingest->notes)},
                                 {"warnings", to_json(inputs.warnings)},
                                 {"provenance",
                                  {{"config", inputs.config->as_written},
                                   {"annotations", inputs.ingest->annotation_digests},
                                   {"veto", describe_veto(inputs.ingest->veto)},
                                   {"corrections", describe_corrections(inputs.ingest->corrections)},
                                   {"leakage", describe_leakage(inputs)},
                                   {"checkpoint_sha256", text_or_null(inputs.assets->checkpoint)},
                                   {"smal_asset_sha256", text_or_null(inputs.assets->smal_asset)},
                                   {"priors_sha256", text_or_null(inputs.assets->priors)},
                                   {"device", text_or_null(inputs.device_key)},
                                   {"stage_keys",
                                    {{"ingest", keys.ingest},
                                     {"predict", keys.predict},
                                     {"fidelity", keys.fidelity},
                                     {"refine", keys.refine},
                                     {"measure", text_or_null(keys.measure)},
                                     {"shards", keys.shards}}}}},
                                 {"verdicts", {{"file", "verdicts.csv"}, {"sha256", verdicts_sha256}}},
                                 {"shards", shard_list}};
  return manifests::seal_json(document);
}

std::string verdicts_csv(const candidates::Ingest& ingest,
                         const std::vector<manifests::Judgement>& judgements) {
  std::string text = "id,verdict,reason,initial_error,final_error,gain,iterations,best_iteration";
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) text.append(",").append(column.name);
  text += ",dataset,split,source,species,family,shard,row,image_sha256,detail\n";
  for (const candidates::Unit& unit : ingest.units) {
    std::int64_t row = 0;
    for (std::size_t i = unit.first; i < unit.first + unit.count; ++i) {
      const manifests::SampleRecord& record = ingest.candidates[i].record;
      const manifests::Judgement& judgement = judgements[i];
      const bool kept = manifests::is_kept(judgement.verdict);
      const bool judged = !std::isnan(judgement.initial_error);
      text += fmt::format(
          "{},{},{},{},{},{},{},{}{},{},{},{},{},{},{},{},{},{}\n", csv_cell(record.id),
          manifests::to_string(judgement.verdict), manifests::to_string(judgement.reason),
          number(judgement.initial_error), number(judgement.final_error), number(judgement.gain),
          judged ? std::to_string(judgement.iterations) : "",
          judged ? std::to_string(judgement.best_iteration) : "", trust_cells(judgement.trust),
          csv_cell(record.dataset), csv_cell(record.split), csv_cell(record.source), csv_cell(record.species),
          manifests::to_string(record.family), kept ? std::to_string(unit.index) : "",
          kept ? std::to_string(row) : "", ingest.candidates[i].image_sha256, csv_cell(judgement.detail));
      if (kept) ++row;
    }
  }
  return text;
}

}  // namespace q3d::pipeline::dataset
