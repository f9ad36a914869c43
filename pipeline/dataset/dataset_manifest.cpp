#include "pipeline/dataset/dataset_manifest.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cmath>

#include "manifests/digest.h"
#include "manifests/enumerators.h"
#include "manifests/sealed_json.h"
#include "manifests/shard.h"
#include "pipeline/config/effective_config.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::Verdict;
using nlohmann::ordered_json;

ordered_json counts_json(const Counts& counts) {
  return {{"candidates", counts.candidates},
          {"retained", counts.retained},
          {"refined", counts.refined},
          {"discarded", counts.discarded},
          {"failed", counts.failed}};
}

// Describes the thresholds of each dataset with pseudo labels. Returns null if there is none.
ordered_json describe_thresholds(const DatasetInputs& inputs) {
  if (!config::needs_network(*inputs.config)) return nullptr;
  ordered_json datasets = ordered_json::object();
  for (const auto& [name, thresholds] : inputs.rules->thresholds) {
    datasets[name] = {
        {"tau_low", thresholds.tau_low}, {"tau_high", thresholds.tau_high}, {"delta", thresholds.delta}};
  }
  return datasets;
}

// Describes every guard with its value, where 0 is off. The path of the priors is left out, because
// `provenance` has their digest.
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

void VerdictBooks::Mean::add(double error) {
  if (std::isnan(error)) return;
  sum += error;
  ++count;
}

void VerdictBooks::Group::add(const manifests::Judgement& judgement) {
  counts.add(judgement.verdict);
  if (!manifests::is_kept(judgement.verdict)) return;
  initial.add(judgement.initial_error);
  final.add(judgement.final_error);
}

void VerdictBooks::add(const candidates::Candidate& candidate, const manifests::Judgement& judgement) {
  const manifests::SampleRecord& record = candidate.record;
  const auto in = [](Groups& groups, const std::string& label) -> Group& {
    return groups[label.empty() ? "unknown" : label];
  };
  counts_.add(judgement.verdict);
  all_.add(judgement);
  in(by_dataset_, candidates::dataset_key(record)).add(judgement);
  in(by_family_, std::string(manifests::to_string(record.family))).add(judgement);
  in(by_species_, record.species).add(judgement);
  if (judgement.reason != manifests::Reason::none) {
    ++reasons_[std::string(manifests::to_string(judgement.reason))];
  }
  if (manifests::is_kept(judgement.verdict)) ++labels_[config::label_kind(candidate.role, judgement.verdict)];
}

ordered_json VerdictBooks::to_json(const Groups& groups) {
  ordered_json object = ordered_json::object();
  for (const auto& [label, group] : groups) {
    ordered_json entry = counts_json(group.counts);
    if (group.initial.count > 0) entry["mean_initial_error_of_kept"] = group.initial.value();
    if (group.final.count > 0) entry["mean_final_error_of_kept"] = group.final.value();
    object[label] = std::move(entry);
  }
  return object;
}

ordered_json VerdictBooks::statistics_json() const {
  ordered_json object = to_json({{"all", all_}});
  object["reasons"] = reasons_;
  object["by_dataset"] = to_json(by_dataset_);
  object["by_family"] = to_json(by_family_);
  object["by_species"] = to_json(by_species_);
  return object;
}

ordered_json VerdictBooks::labels_json() const {
  using manifests::LabelKind;
  ordered_json labels = ordered_json::object();
  for (const LabelKind kind :
       {LabelKind::truth, LabelKind::retained, LabelKind::refined, LabelKind::two_d_only}) {
    const auto found = labels_.find(kind);
    labels[std::string(manifests::to_string(kind))] = found == labels_.end() ? 0 : found->second;
  }
  return labels;
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

std::string dataset_json(const DatasetInputs& inputs, const VerdictBooks& books,
                         const std::vector<ShardEntry>& shards, const std::string& verdicts_sha256) {
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
                                 {"counts", counts_json(books.counts())},
                                 {"labels", books.labels_json()},
                                 {"datasets", describe_datasets(*inputs.config)},
                                 {"profile", inputs.config->profile},
                                 {"thresholds", describe_thresholds(inputs)},
                                 {"guards", describe_guards(inputs)},
                                 {"statistics", books.statistics_json()},
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

}  // namespace q3d::pipeline::dataset
