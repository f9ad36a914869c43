#include "pipeline/dataset/published_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "manifests/digest.h"
#include "manifests/enumerators.h"
#include "manifests/journal.h"
#include "manifests/spelling.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kShownIds = 20;

// The candidates that a part of an id may mean, and ids to propose if it means none.
class NearIds {
 public:
  explicit NearIds(const std::string& given) : given_(given) {
    const std::string part = given.substr(given.rfind('/') + 1);
    picture_ = part.substr(0, part.find('#'));
  }

  void offer(const VerdictRow& row) {
    if (row.id.find(given_) != std::string::npos) {
      if (matches_++ == 0) match_ = row;
      if (matching_ids_.size() < kShownIds) matching_ids_.push_back(row.id);
    }
    const bool is_near = row.id.find(picture_) != std::string::npos;
    if (near_ids_.size() < 1000 && (is_near || near_ids_.size() < 10)) near_ids_.push_back(row.id);
  }

  // Returns the only candidate that the part fits. Throws std::runtime_error that lists the candidates if it
  // fits several, or names the nearest if it fits none.
  VerdictRow only_match(const fs::path& file) const {
    if (matches_ == 1) return *match_;
    if (matches_ > 1) {
      const std::string more = matches_ > matching_ids_.size()
                                   ? fmt::format("\n  and {} more", matches_ - matching_ids_.size())
                                   : std::string();
      throw std::runtime_error(
          fmt::format("{}: \"{}\" is a part of the ids of {} candidates; give more of one of them:\n  {}{}",
                      file.string(), given_, matches_, fmt::join(matching_ids_, "\n  "), more));
    }
    const std::string nearest = manifests::nearest_word(given_, near_ids_);
    throw std::runtime_error(fmt::format("{}: no candidate has \"{}\" as its id or as a part of its id{}",
                                         file.string(), given_,
                                         nearest.empty() ? "" : fmt::format("; the nearest is {}", nearest)));
  }

 private:
  const std::string& given_;
  std::string picture_;
  std::size_t matches_ = 0;
  std::optional<VerdictRow> match_;  // the first
  std::vector<std::string> matching_ids_;
  std::vector<std::string> near_ids_;
};

}  // namespace

PublishedDataset::PublishedDataset(const fs::path& given)
    : folder_(dataset_folder(given)), manifest_(read_dataset_manifest(folder_)) {}

std::string PublishedDataset::version_name() const {
  return fs::canonical(folder_).filename().string();
}

std::vector<VerdictRow> PublishedDataset::verdicts() const {
  VerdictReader reader(verdicts_file());
  std::vector<VerdictRow> rows;
  while (auto row = reader.next()) rows.push_back(std::move(*row));
  return rows;
}

VerdictRow PublishedDataset::verdict(const std::string& id) const {
  VerdictReader reader(verdicts_file());
  NearIds near(id);
  while (auto row = reader.next()) {
    if (row->id == id) return std::move(*row);
    near.offer(*row);
  }
  return near.only_match(verdicts_file());
}

config::Role PublishedDataset::role(const VerdictRow& row) const {
  const auto found = manifest_.roles.find(row.dataset + "/" + row.split);
  if (found != manifest_.roles.end()) return found->second;
  throw std::runtime_error(fmt::format("{}: the candidate {} is of {}/{}, which dataset.json does not list",
                                       verdicts_file().string(), row.id, row.dataset, row.split));
}

std::optional<manifests::LabelKind> PublishedDataset::label_kind(const VerdictRow& row) const {
  if (!manifests::is_kept(row.judgement.verdict)) return std::nullopt;
  return config::label_kind(role(row), row.judgement.verdict);
}

const ShardEntry& PublishedDataset::shard_of_unit(std::int64_t unit) const {
  const auto found = std::find_if(manifest_.shards.begin(), manifest_.shards.end(),
                                  [&](const ShardEntry& shard) { return shard.unit == unit; });
  if (found != manifest_.shards.end()) return *found;
  throw std::runtime_error(fmt::format("{}: no shard of unit {}", (folder_ / "dataset.json").string(), unit));
}

manifests::ShardReader PublishedDataset::open_shard(const ShardEntry& shard) const {
  return manifests::ShardReader(shard_file(shard));
}

manifests::ShardSample PublishedDataset::sample(const VerdictRow& row) const {
  if (!row.label) throw std::logic_error("PublishedDataset::sample: " + row.id + " is not kept");
  const ShardEntry& entry = shard_of_unit(row.label->shard);
  const manifests::ShardReader shard = open_shard(entry);
  if (row.label->row < shard.rows()) {
    manifests::ShardSample sample = std::move(shard.samples(row.label->row, 1).front());
    if (sample.record.id == row.id) return sample;
  }
  throw std::runtime_error(fmt::format("{}: row {} is not {}, as verdicts.csv says; run `verify`",
                                       shard_file(entry).string(), row.label->row, row.id));
}

std::int64_t PublishedDataset::unit_of(const VerdictRow& row) const {
  return static_cast<std::int64_t>(row.position / manifest_.unit_size);
}

std::size_t PublishedDataset::place_in_unit(const VerdictRow& row) const {
  return row.position % manifest_.unit_size;
}

fs::path PublishedDataset::output_folder() const {
  return fs::canonical(folder_).parent_path();
}

std::optional<manifests::Table> PublishedDataset::stage_table(const char* stage, const std::string& key,
                                                              std::int64_t unit) const {
  if (key.empty()) return std::nullopt;
  const fs::path folder = stages::stage_folder(output_folder(), stage, key);
  const fs::path file = stages::unit_file(folder, unit);
  if (!fs::exists(file) || !fs::exists(folder / "journal.jsonl")) return std::nullopt;
  const manifests::Journal journal(folder / "journal.jsonl");
  const auto entry = journal.entries().find(unit);
  if (entry == journal.entries().end()) return std::nullopt;
  const std::string digest = manifests::sha256_file(file);
  if (digest != entry->second.sha256) {
    throw std::runtime_error(
        fmt::format("{}: its SHA-256 is {}, its journal says {}; remove the file and build again",
                    file.string(), digest, entry->second.sha256));
  }
  return manifests::read_table(file);
}

std::optional<UnitPredictions> PublishedDataset::predictions(std::int64_t unit) const {
  const auto table = stage_table("predict", manifest_.keys.predict, unit);
  if (!table) return std::nullopt;
  UnitPredictions predictions;
  for (std::size_t row = 0; row < static_cast<std::size_t>(table->rows); ++row) {
    predictions.candidates.push_back(unit::candidate_from_table(*table, row));
  }
  predictions.samples = unit::predicted_from_table(*table);
  return predictions;
}

std::optional<std::vector<unit::RefinedSample>> PublishedDataset::refinements(std::int64_t unit) const {
  const auto table = stage_table("refine", manifest_.keys.refine, unit);
  return table ? std::optional(unit::refined_from_table(*table)) : std::nullopt;
}

std::optional<std::vector<unit::MeasuredLabel>> PublishedDataset::measures(std::int64_t unit) const {
  const auto table = stage_table("measure", manifest_.keys.measure, unit);
  return table ? std::optional(unit::measured_from_table(*table)) : std::nullopt;
}

}  // namespace q3d::pipeline::dataset
