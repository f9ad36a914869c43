#include "pipeline/candidates/configured_dataset.h"

#include <fmt/format.h>

#include <set>
#include <stdexcept>

#include "loaders/species/species.h"
#include "pipeline/candidates/curation_list.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {
namespace {

loaders::formats::Dataset load(const loaders::formats::DatasetOptions& options) {
  try {
    return loaders::formats::load_dataset(options);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(fmt::format("dataset {}: {}", options.name, error.what()));
  }
}

void complete_species(const std::string& listed, manifests::SampleRecord& record) {
  if (!record.species.empty()) return;
  record.species = listed;
  if (record.family == manifests::Family::none) {
    record.family = loaders::species::family_of_species(listed).value_or(manifests::Family::none);
  }
}

void keep_chosen(const config::DatasetConfig& options, loaders::formats::Dataset& dataset) {
  const std::map<std::string, std::string> chosen = chosen_pictures(options.curation, options.split);
  const std::string name = options.name + "/" + options.split;
  if (chosen.empty()) {
    throw run::ConfigError(fmt::format("dataset {}: curation: {} chooses no picture of the split \"{}\"",
                                       options.name, options.curation.string(), options.split));
  }
  std::set<std::string> seen;
  std::vector<manifests::SampleRecord> kept;
  for (manifests::SampleRecord& record : dataset.records) {
    const auto found = chosen.find(record.image_ref);
    if (found == chosen.end()) continue;
    seen.insert(record.image_ref);
    complete_species(found->second, record);
    kept.push_back(std::move(record));
  }
  for (const auto& [picture, species] : chosen) {
    if (seen.contains(picture)) continue;
    throw run::ConfigError(
        fmt::format("dataset {}: curation: {} chooses {} pictures that the dataset does not have, the first "
                    "is {}; the list belongs to other annotation files. Run `quadruped3d curate` again",
                    name, options.curation.string(), chosen.size() - seen.size(), picture));
  }
  dataset.notes.push_back(
      {loaders::formats::NoteKind::remark, fmt::format("curation takes {} pictures: {} of {} samples",
                                                       chosen.size(), kept.size(), dataset.records.size())});
  dataset.records = std::move(kept);
  dataset.files.push_back(options.curation);
}

}  // namespace

loaders::formats::Dataset load_configured(const config::DatasetConfig& options) {
  loaders::formats::Dataset dataset = load(options);
  if (!options.curation.empty()) keep_chosen(options, dataset);
  return dataset;
}

}  // namespace q3d::pipeline::candidates
