#include "pipeline/candidates/configured_dataset.h"

#include <fmt/format.h>

#include <iterator>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "loaders/species/species.h"
#include "pipeline/candidates/curation_list.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {
namespace {

using loaders::formats::Dataset;
using loaders::formats::TakeRecords;
using manifests::SampleRecord;

Dataset stream(const loaders::formats::DatasetOptions& options, const TakeRecords& take) {
  try {
    return loaders::formats::stream_dataset(options, take);
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

// The pictures that a curation list chose.
class Choice {
 public:
  explicit Choice(const config::DatasetConfig& options)
      : options_(options), chosen_(chosen_pictures(options.curation, options.split)) {
    if (!chosen_.empty()) return;
    throw run::ConfigError(fmt::format("dataset {}: curation: {} chooses no picture of the split \"{}\"",
                                       options.name, options.curation.string(), options.split));
  }

  std::vector<SampleRecord> keep(std::vector<SampleRecord>&& records) {
    records_ += records.size();
    std::vector<SampleRecord> kept;
    for (SampleRecord& record : records) {
      const auto found = chosen_.find(record.image_ref);
      if (found == chosen_.end()) continue;
      seen_.insert(record.image_ref);
      complete_species(found->second, record);
      kept.push_back(std::move(record));
    }
    kept_ += kept.size();
    return kept;
  }

  // Call this after all records. It refuses a list that was made for other files, and notes the choice.
  void finish(Dataset& dataset) const {
    for (const auto& [picture, species] : chosen_) {
      if (seen_.contains(picture)) continue;
      throw run::ConfigError(fmt::format(
          "dataset {}/{}: curation: {} chooses {} pictures that the dataset does not have, the "
          "first is {}; the list belongs to other annotation files. Run `quadruped3d curate` again",
          options_.name, options_.split, options_.curation.string(), chosen_.size() - seen_.size(), picture));
    }
    dataset.notes.push_back(
        {loaders::formats::NoteKind::remark,
         fmt::format("curation takes {} pictures: {} of {} samples", chosen_.size(), kept_, records_)});
    dataset.files.push_back(options_.curation);
  }

 private:
  const config::DatasetConfig& options_;
  std::map<std::string, std::string> chosen_;  // picture -> species
  std::set<std::string> seen_;
  std::size_t records_ = 0;
  std::size_t kept_ = 0;
};

}  // namespace

Dataset stream_configured(const config::DatasetConfig& options, const TakeRecords& take) {
  if (options.curation.empty()) return stream(options, take);
  Choice choice(options);
  Dataset dataset =
      stream(options, [&](std::vector<SampleRecord>&& records) { take(choice.keep(std::move(records))); });
  choice.finish(dataset);
  return dataset;
}

Dataset load_configured(const config::DatasetConfig& options) {
  std::vector<SampleRecord> records;
  Dataset dataset = stream_configured(options, [&](std::vector<SampleRecord>&& part) {
    records.insert(records.end(), std::make_move_iterator(part.begin()), std::make_move_iterator(part.end()));
  });
  dataset.records = std::move(records);
  return dataset;
}

}  // namespace q3d::pipeline::candidates
