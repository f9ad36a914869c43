// Reads a finished dataset: dataset.json, verdicts.csv, the shards, and the tables of the stages if they lie
// beside it. All values are typed values and enumerators.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/shard.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/dataset/verdicts.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::dataset {

// The candidates of one unit and their predictions.
struct UnitPredictions {
  std::vector<manifests::SampleRecord> candidates;  // id, image_ref, box and keypoints; nothing else is set
  std::vector<unit::PredictedSample> samples;       // of the same candidates, in the same order
};

class PublishedDataset {
 public:
  // `given` is a version's folder, or an output folder, of which the newest version is taken. Reads
  // dataset.json; everything else is opened when it is asked for. Throws std::runtime_error that names the
  // file if there is no dataset, or one that this toolkit cannot read.
  explicit PublishedDataset(const std::filesystem::path& given);

  const std::filesystem::path& folder() const { return folder_; }
  // Returns the version's own name, "<name>-<first 12 hex digits of the key>", even if `given` was a link to
  // it.
  std::string version_name() const;
  const DatasetManifest& manifest() const { return manifest_; }

  std::filesystem::path verdicts_file() const { return folder_ / "verdicts.csv"; }
  // Returns all rows in ingest order. Throws like VerdictReader.
  std::vector<VerdictRow> verdicts() const;
  // Returns the row of the candidate with this id, else of the only candidate whose id contains it. Throws
  // std::runtime_error that lists the candidates if several ids contain it, or names the nearest id if none
  // does, and like VerdictReader.
  VerdictRow verdict(const std::string& id) const;
  config::Role role(const VerdictRow& row) const;  // throws std::runtime_error for an unknown dataset
  // Returns nothing unless the candidate is kept.
  std::optional<manifests::LabelKind> label_kind(const VerdictRow& row) const;

  std::filesystem::path shard_file(const ShardEntry& shard) const { return folder_ / shard.file; }
  // Returns the shard of a unit. Throws std::runtime_error if dataset.json lists none.
  const ShardEntry& shard_of_unit(std::int64_t unit) const;
  manifests::ShardReader open_shard(const ShardEntry& shard) const;  // throws like ShardReader
  // Returns the shard's row of a kept candidate. Throws std::runtime_error if that row holds another
  // candidate.
  manifests::ShardSample sample(const VerdictRow& row) const;

  // These return the unit of a candidate, and its position in the unit.
  std::int64_t unit_of(const VerdictRow& row) const;
  std::size_t place_in_unit(const VerdictRow& row) const;
  // Returns the output folder that holds the version and, unless the version was moved, the stages.
  std::filesystem::path output_folder() const;
  // These return the tables of one unit, or nothing if the stage's folder is gone or does not hold this unit.
  // A later build may have replaced a unit's tables by those of other candidates, so compare the ids of
  // predictions(). Throws std::runtime_error for a table that is damaged.
  std::optional<UnitPredictions> predictions(std::int64_t unit) const;
  std::optional<std::vector<unit::RefinedSample>> refinements(std::int64_t unit) const;
  std::optional<std::vector<unit::MeasuredLabel>> measures(std::int64_t unit) const;

 private:
  std::optional<manifests::Table> stage_table(const char* stage, const std::string& key,
                                              std::int64_t unit) const;

  std::filesystem::path folder_;
  DatasetManifest manifest_;
};

}  // namespace q3d::pipeline::dataset
