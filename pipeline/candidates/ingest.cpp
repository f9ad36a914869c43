#include "pipeline/candidates/ingest.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/json_parse.h"
#include "manifests/record_json.h"
#include "pipeline/candidates/body_check.h"
#include "pipeline/candidates/configured_dataset.h"
#include "pipeline/candidates/duplicates.h"
#include "pipeline/candidates/picture_fit.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::candidates {
namespace {

using manifests::Reason;

// One file's own digest, or one over the digests of several.
std::string digest_files(const std::vector<std::filesystem::path>& files, manifests::DigestCache& digests) {
  if (files.size() == 1) return digests.digest(files.front());
  std::string text;
  for (const auto& file : files) text += digests.digest(file) + '\n';
  return manifests::sha256(text);
}

void require_unique_ids(const std::vector<Candidate>& candidates) {
  std::set<std::string_view> seen;
  for (const Candidate& candidate : candidates) {
    if (!seen.insert(candidate.record.id).second) {
      throw std::runtime_error(fmt::format("the sample id {} occurs twice; ids must be unique within a build",
                                           candidate.record.id));
    }
  }
}

// Paths of this machine do not belong into a dataset: equal builds in different folders have equal verdicts.
std::string without_root(std::string text, const std::filesystem::path& root) {
  const std::string prefix = (root / "").string();
  for (std::size_t at = text.find(prefix); at != std::string::npos; at = text.find(prefix, at)) {
    text.erase(at, prefix.size());
  }
  return text;
}

std::string note_of(const Corrections& corrections, const std::filesystem::path& file) {
  return fmt::format(
      "corrections {}: the keypoints of {} candidates are replaced; {} of its ids are no candidate's",
      file.filename().string(), corrections.matched, corrections.points.size() - corrections.matched);
}

// A label must have what its role promises.
void check_role(config::Role role, manifests::SampleRecord& record) {
  if (role != config::Role::truth || record.failure != Reason::none) return;
  if (record.truth && record.truth->has_pose) return;
  record.failure = Reason::pose_missing;
  record.failure_detail =
      "pose: got nothing, or zeros throughout; expected 35 rotations, since the dataset's role is \"truth\"";
}

// A picture that is not there is a failed sample, never a failed build; a mask is then none. A file that is
// there and cannot be read stops the run.
void digest_pictures(std::vector<Candidate>& candidates, manifests::DigestCache& digests) {
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    Candidate& candidate = candidates[i];
    if (candidate.record.failure != Reason::none || run::interrupted()) return;
    if (auto digest = digests.digest_if_present(candidate.record.image_path)) {
      candidate.image_sha256 = std::move(*digest);
    } else {
      candidate.record.failure = Reason::image_missing;
      candidate.record.failure_detail = candidate.record.image_ref + " cannot be read";
    }
    if (candidate.record.mask_path.empty()) return;
    candidate.mask_sha256 = digests.digest_if_present(candidate.record.mask_path).value_or("");
  });
  run::throw_if_interrupted();
}

// Returns the terms of the datasets as the config states them, as text, by dataset_key. A dataset without
// terms is left out.
std::map<std::string, std::string> texts_of_terms(const config::BuildConfig& config) {
  std::map<std::string, std::string> texts;
  for (const config::DatasetConfig& dataset : config.datasets) {
    if (dataset.licence.empty() && dataset.source_url.empty() && dataset.citation.empty()) continue;
    const nlohmann::json parts{dataset.licence, dataset.source_url, dataset.citation};
    texts[dataset.name + "/" + dataset.split] = parts.dump();
  }
  return texts;
}

std::string digest_labels(const Unit& unit, const std::vector<Candidate>& candidates,
                          const std::map<std::string, std::string>& terms) {
  std::map<std::string, std::string> own;
  for (std::size_t i = unit.first; i < unit.first + unit.count; ++i) {
    if (const auto found = terms.find(dataset_key(candidates[i].record)); found != terms.end())
      own.insert(*found);
  }
  return own.empty() ? unit.input_digest
                     : manifests::sha256(unit.input_digest + '\n' + nlohmann::json(own).dump());
}

std::vector<Unit> cut_units(const std::vector<Candidate>& candidates, const config::BuildConfig& config) {
  const auto unit_size = static_cast<std::size_t>(config.shards.unit_size);
  const std::map<std::string, std::string> terms = texts_of_terms(config);
  std::vector<Unit> units;
  for (std::size_t first = 0; first < candidates.size(); first += unit_size) {
    Unit unit;
    unit.index = static_cast<std::int64_t>(units.size());
    unit.first = first;
    unit.count = std::min(unit_size, candidates.size() - first);
    std::string text;
    for (std::size_t i = first; i < first + unit.count; ++i) {
      text += manifests::record_digest(candidates[i].record) + ' ' + candidates[i].image_sha256 + ' ' +
              candidates[i].mask_sha256 + ' ';
      text += std::string(to_string(candidates[i].role)) + '\n';
      if (!candidates[i].finding.empty()) text += candidates[i].finding + '\n';
    }
    unit.input_digest = manifests::sha256(text);
    unit.label_digest = digest_labels(unit, candidates, terms);
    units.push_back(std::move(unit));
  }
  return units;
}

// Findings of all records; none without a body model.
std::vector<std::string> check_truth(const config::DatasetConfig& options,
                                     const device::BodyMeshesLoader& load_bodies,
                                     loaders::formats::Dataset& dataset) {
  if (options.body_model.empty() || !load_bodies) return std::vector<std::string>(dataset.records.size());
  const std::unique_ptr<device::BodyMeshes> bodies = load_bodies(options.body_model);
  BodyCheck check = check_bodies(*bodies, options.keypoints_3d_of_body, dataset.records);
  dataset.notes.push_back({loaders::formats::NoteKind::remark, to_note(check)});
  return std::move(check.findings);
}

}  // namespace

bool is_rendered(const std::filesystem::path& root) {
  const std::filesystem::path folder = std::filesystem::absolute(root / ".").lexically_normal().parent_path();
  for (const auto& place : {folder, folder.parent_path()}) {
    const std::filesystem::path file = place / "world.json";
    if (!std::filesystem::is_regular_file(file)) continue;
    const auto world = manifests::parse_json_or_null<nlohmann::json>(manifests::read_file(file));
    const auto options = world.is_object() ? world.find("options") : world.end();
    if (options != world.end() && options->contains("picture_px") && options->contains("seed")) return true;
  }
  return false;
}

std::string dataset_key(const manifests::SampleRecord& record) {
  return record.dataset + "/" + record.split;
}

IngestedDataset read_dataset(const config::DatasetConfig& options, manifests::DigestCache& digests) {
  run::throw_if_interrupted();
  loaders::formats::Dataset dataset = load_configured(options);
  fit_to_pictures(options, dataset);
  for (auto& record : dataset.records) {
    record.failure_detail = without_root(std::move(record.failure_detail), options.root);
  }
  for (auto& note : dataset.notes) note.text = without_root(std::move(note.text), options.root);
  std::string digest = digest_files(dataset.files, digests);
  return {std::move(dataset), std::move(digest)};
}

Ingest ingest(const config::BuildConfig& config, manifests::DigestCache& digests,
              const device::BodyMeshesLoader& load_bodies) {
  Ingest result;
  if (!config.corrections.empty()) result.corrections = read_corrections(config.corrections);
  for (const auto& options : config.datasets) {
    auto [dataset, digest] = read_dataset(options, digests);
    const std::string name = options.name + "/" + options.split;
    result.annotation_digests[name] = std::move(digest);
    result.files.insert(result.files.end(), dataset.files.begin(), dataset.files.end());
    if (is_rendered(options.root)) result.rendered.insert(name);
    if (result.corrections) apply_corrections(*result.corrections, dataset.records);
    for (auto& record : dataset.records) check_role(options.role, record);
    std::vector<std::string> findings = check_truth(options, load_bodies, dataset);
    for (std::size_t i = 0; i < dataset.records.size(); ++i) {
      result.candidates.push_back(
          {std::move(dataset.records[i]), {}, {}, options.role, std::move(findings[i])});
    }
    for (auto& note : dataset.notes) result.notes.push_back({note.kind, name, std::move(note.text)});
  }
  if (result.corrections) {
    result.notes.push_back(
        {loaders::formats::NoteKind::remark, {}, note_of(*result.corrections, config.corrections)});
  }
  require_unique_ids(result.candidates);
  digest_pictures(result.candidates, digests);
  fail_duplicates(result.candidates, result.notes);
  digests.save();
  result.units = cut_units(result.candidates, config);
  return result;
}

}  // namespace q3d::pipeline::candidates
