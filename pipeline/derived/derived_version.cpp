#include "pipeline/derived/derived_version.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/link_file.h"
#include "manifests/sealed_json.h"
#include "manifests/trust.h"
#include "pipeline/dataset/is_published.h"
#include "pipeline/derived/derived_manifest.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::derived {
namespace {

namespace fs = std::filesystem;
using dataset::ShardEntry;
using dataset::VerdictRow;
using nlohmann::ordered_json;

std::string key_of(const ordered_json& how, const std::vector<Selection>& selections) {
  std::string text = how.dump() + "\n";
  for (const Selection& selection : selections) {
    const dataset::DatasetManifest& manifest = selection.dataset.manifest();
    text += manifest.key + " " + manifest.content_id + " " + manifest.verdicts_sha256 + "\n";
  }
  return manifests::sha256(text);
}

void require_unique_ids(const std::vector<Selection>& selections) {
  std::set<std::string> ids;
  for (const Selection& selection : selections) {
    for (const VerdictRow& row : selection.rows) {
      if (!ids.insert(row.id).second) {
        throw std::logic_error("write_derived: the id " + row.id + " is selected twice");
      }
    }
  }
  if (ids.empty()) throw run::ConfigError("no candidate is selected, so there is nothing to write");
}

// Writes the shards of all selections and gives the rows their new places.
class ShardWriter {
 public:
  ShardWriter(const fs::path& folder, DerivedVersion& result) : folder_(folder), result_(result) {
    fs::create_directories(folder_ / "shards");
    manifests::remove_temporaries(folder_);  // of a killed run
    manifests::remove_temporaries(folder_ / "shards");
  }

  void write(std::vector<Selection>& selections) {
    for (const ShardEntry& entry : selections.front().dataset.manifest().shards) {
      next_unit_ = std::max(next_unit_, entry.unit + 1);
    }
    for (Selection& selection : selections) {
      const bool is_first = &selection == &selections.front();
      for (const ShardEntry& entry : selection.dataset.manifest().shards) {
        run::throw_if_interrupted();
        write_shard_of(selection, entry, is_first);
      }
    }
  }

  const std::vector<ShardEntry>& entries() const { return entries_; }

 private:
  void write_shard_of(Selection& selection, const ShardEntry& entry, bool is_first) {
    std::vector<VerdictRow*> kept;
    for (VerdictRow& row : selection.rows) {
      if (row.label && row.label->shard == entry.unit && !placed_.contains(&row)) kept.push_back(&row);
    }
    if (kept.empty()) return;
    const std::int64_t unit = is_first ? entry.unit : next_unit_++;
    const std::string name = fmt::format("shards/{:06}.h5", unit);
    const fs::path source = selection.dataset.shard_file(entry);
    if (const std::string digest = manifests::sha256_file(source); digest != entry.sha256) {
      throw std::runtime_error(fmt::format("{}: SHA-256 is {}, dataset.json says {}; run `verify`",
                                           source.string(), digest, entry.sha256));
    }
    if (is_first && static_cast<std::int64_t>(kept.size()) == entry.rows) {
      manifests::link_or_copy(source, folder_ / name);
      ++result_.shards_linked;
      entries_.push_back({name, entry.sha256, entry.bytes, entry.rows, unit});
    } else {
      write_rows(selection, entry, kept, unit, name);
    }
    for (std::size_t i = 0; i < kept.size(); ++i) {
      placed_.insert(kept[i]);
      kept[i]->label = VerdictRow::LabelPlace{unit, static_cast<std::int64_t>(i)};
    }
  }

  void write_rows(const Selection& selection, const ShardEntry& entry, const std::vector<VerdictRow*>& kept,
                  std::int64_t unit, const std::string& name) {
    const manifests::ShardReader shard = selection.dataset.open_shard(entry);
    std::vector<manifests::ShardSample> samples;
    for (const VerdictRow* row : kept) {
      samples.push_back(std::move(shard.samples(row->label->row, 1).front()));
      if (samples.back().record.id != row->id) {
        throw std::runtime_error(fmt::format("{}: row {} is not {}, as verdicts.csv says; run `verify`",
                                             selection.dataset.shard_file(entry).string(), row->label->row,
                                             row->id));
      }
    }
    manifests::ShardHeader header = shard.header();
    header.schema = manifests::kShardSchema;
    header.unit = unit;
    const std::string digest = manifests::write_shard(folder_ / name, header, samples);
    ++result_.shards_written;
    entries_.push_back({name, digest, static_cast<std::int64_t>(fs::file_size(folder_ / name)),
                        static_cast<std::int64_t>(samples.size()), unit});
  }

  fs::path folder_;
  DerivedVersion& result_;
  std::int64_t next_unit_ = 0;
  std::set<const VerdictRow*> placed_;
  std::vector<ShardEntry> entries_;
};

}  // namespace

DerivedVersion write_derived(const fs::path& out, const std::string& name, const std::string& version,
                             std::vector<Selection> selections, const ordered_json& how) {
  require_unique_ids(selections);
  const std::string key = key_of(how, selections);
  DerivedVersion result;
  result.folder = out / (name + "-" + key.substr(0, stages::kShortKey));
  for (const Selection& selection : selections) {
    for (const VerdictRow& row : selection.rows) result.counts.add(row.judgement.verdict);
  }
  ordered_json document = derived_manifest(selections, how);  // before anything is written: it may refuse
  result.was_up_to_date = dataset::is_published(result.folder, key);
  if (result.was_up_to_date) return result;
  ShardWriter writer(result.folder, result);
  writer.write(selections);
  const std::string csv = derived_verdicts(selections);
  manifests::write_file_atomically(result.folder / "verdicts.csv", csv);
  document["name"] = name;
  document["version"] = version;
  document["key"] = key;
  document["content_id"] = dataset::content_id(writer.entries());
  document["verdicts"] = {{"file", "verdicts.csv"}, {"sha256", manifests::sha256(csv)}};
  document["shards"] = ordered_json::array();
  for (const ShardEntry& entry : writer.entries()) {
    document["shards"].push_back({{"file", entry.file},
                                  {"unit", entry.unit},
                                  {"rows", entry.rows},
                                  {"bytes", entry.bytes},
                                  {"sha256", entry.sha256}});
  }
  manifests::sync_folder(result.folder / "shards");
  manifests::write_file_atomically(result.folder / "dataset.json", manifests::seal_json(document));
  manifests::sync_folder(out);
  return result;
}

}  // namespace q3d::pipeline::derived
