#include "pipeline/curation/curate_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "loaders/curation/clip.h"
#include "loaders/curation/source_labels.h"
#include "loaders/species/species.h"
#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/candidates/configured_dataset.h"
#include "pipeline/candidates/curation_list.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::curation {
namespace {

using loaders::curation::Choice;
using loaders::curation::Curated;
using loaders::curation::CuratedPicture;
using nlohmann::ordered_json;

// The labels that the sources' own files give for pictures, by normalised sub-dataset.
using LabelsOfSource = std::map<std::string, loaders::curation::SourceLabels>;

struct Inputs {
  std::map<std::string, std::string> digests;  // SHA-256 of the files, by dataset/split or source, and name
  std::vector<std::string> notes;
};

LabelsOfSource read_sources(const CurationConfig& config, Inputs& inputs) {
  LabelsOfSource labels;
  for (const CurationSource& source : config.sources) {
    for (const auto& file : source.annotations) {
      run::throw_if_interrupted();
      labels[loaders::species::normalised_source(source.source)].add(file);
      inputs.digests[source.source + " " + file.filename().string()] = manifests::sha256_file(file);
    }
  }
  return labels;
}

// Adds the pictures of one split in the order of their first records. A picture with animals of different
// species has no species.
void add_pictures(const loaders::formats::Dataset& dataset, std::vector<CuratedPicture>& pictures) {
  std::unordered_map<std::string_view, std::size_t> place_of;
  for (const manifests::SampleRecord& record : dataset.records) {
    const bool usable = record.failure == manifests::Reason::none;
    const auto [found, is_new] = place_of.emplace(record.image_ref, pictures.size());
    if (is_new) {
      pictures.push_back({record.split, record.image_ref, record.source, record.species, {}, usable});
      continue;
    }
    CuratedPicture& picture = pictures[found->second];
    picture.usable = picture.usable || usable;
    if (picture.species != record.species) picture.species.clear();
  }
}

// Fills in species and video from the source's own files if names do not tell them.
void complete(const CurationConfig& config, const LabelsOfSource& labels, CuratedPicture& picture) {
  const std::string source = loaders::species::normalised_source(picture.source);
  const auto known = labels.find(source);
  if (known != labels.end()) {
    if (const auto label = known->second.find(picture.image_ref)) {
      if (picture.species.empty()) picture.species = label->species;
      picture.clip = label->clip;
    }
  }
  const bool is_video = std::any_of(
      config.videos.begin(), config.videos.end(),
      [&](const std::string& video) { return loaders::species::normalised_source(video) == source; });
  if (!is_video) {
    picture.clip.clear();
  } else if (picture.clip.empty()) {
    picture.clip = "names " + loaders::curation::clip_of_frame(picture.image_ref);
  }
}

std::vector<CuratedPicture> read_pictures(const CurationConfig& config, Inputs& inputs) {
  const LabelsOfSource labels = read_sources(config, inputs);
  std::vector<CuratedPicture> pictures;
  for (const config::DatasetConfig& options : config.datasets) {
    run::throw_if_interrupted();
    const loaders::formats::Dataset dataset = candidates::load_configured(options);
    const std::string name = options.name + "/" + options.split;
    for (const auto& file : dataset.files) {
      inputs.digests[name + " " + file.filename().string()] = manifests::sha256_file(file);
    }
    for (const auto& note : dataset.notes) inputs.notes.push_back(name + ": " + note.text);
    add_pictures(dataset, pictures);
  }
  for (CuratedPicture& picture : pictures) complete(config, labels, picture);
  return pictures;
}

void count(const std::vector<CuratedPicture>& pictures, const std::vector<Curated>& choices,
           CurationSummary& summary) {
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const auto& [species, choice] = choices[i];
    const std::string& split = pictures[i].split;
    ++summary.verdicts[split][std::string(to_string(choice))];
    if (choice == Choice::species_not_listed) ++summary.species_not_listed[species];
    if (choice == Choice::chosen || choice == Choice::not_drawn) ++summary.available[species][split];
    if (choice == Choice::chosen) ++summary.chosen[species][split];
  }
}

// Warns of the most common mistakes in a rule: a species without pictures, and names without a species.
void add_warnings(const CurationConfig& config, CurationSummary& summary) {
  for (const auto& [species, names] : config.rule.species) {
    if (!summary.available.contains(species)) {
      summary.notes.push_back(fmt::format("no picture is a {}'s", species));
    }
  }
  for (const auto& [split, wanted] : config.rule.pictures) {
    const std::int64_t chosen = summary.verdicts[split]["chosen"];
    if (chosen < wanted) {
      summary.notes.push_back(
          fmt::format("{}: {} pictures could be chosen, {} were asked for", split, chosen, wanted));
    }
    if (const std::int64_t unknown = summary.verdicts[split]["species_unknown"]; unknown > 0) {
      summary.notes.push_back(
          fmt::format("{}: {} pictures tell no species; name their sub-dataset's own annotation files under "
                      "\"sources\"",
                      split, unknown));
    }
  }
}

std::vector<Curated> curated(const std::vector<CuratedPicture>& pictures,
                             const loaders::curation::CurationRule& rule) {
  try {
    return loaders::curation::curate(pictures, rule);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(error.what());
  }
}

}  // namespace

CurationSummary run_curate(const CurationConfig& config, const std::filesystem::path& out) {
  Inputs inputs;
  const std::vector<CuratedPicture> pictures = read_pictures(config, inputs);
  const std::vector<Curated> choices = curated(pictures, config.rule);
  CurationSummary summary;
  summary.notes = std::move(inputs.notes);
  count(pictures, choices, summary);
  add_warnings(config, summary);
  std::filesystem::create_directories(out);
  const std::string csv = candidates::curation_csv(pictures, choices);
  summary.list = out / (config.name + ".csv");
  const ordered_json document = {
      {"list", {{"file", config.name + ".csv"}, {"sha256", manifests::sha256(csv)}}},
      {"config", config.as_written},
      {"inputs", inputs.digests},
      {"verdicts", summary.verdicts},
      {"chosen", summary.chosen},
      {"available", summary.available},
      {"species_not_listed", summary.species_not_listed}};
  manifests::write_file_atomically(summary.list, csv);
  manifests::write_file_atomically(out / (config.name + ".json"), document.dump(2) + "\n");
  return summary;
}

}  // namespace q3d::pipeline::curation
