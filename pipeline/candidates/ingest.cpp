#include "pipeline/candidates/ingest.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <compare>
#include <deque>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "manifests/atomic_file.h"
#include "manifests/json_parse.h"
#include "manifests/record_json.h"
#include "manifests/valid_utf8.h"
#include "pipeline/candidates/body_check.h"
#include "pipeline/candidates/configured_dataset.h"
#include "pipeline/candidates/duplicates.h"
#include "pipeline/candidates/local_folders.h"
#include "pipeline/candidates/picture_fit.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::candidates {
namespace {

using manifests::Reason;

// Returns the digest of a single file, or a digest over the digests of several files.
std::string digest_files(const std::vector<std::filesystem::path>& files, manifests::DigestCache& digests) {
  if (files.size() == 1) return digests.digest(files.front());
  std::string text;
  for (const auto& file : files) text += digests.digest(file) + '\n';
  return manifests::sha256(text);
}

// Finds ids that occur twice. It holds a 64-bit hash of every id; ids with equal hashes are compared as
// texts.
class UniqueIds {
 public:
  void add(std::size_t index, const std::string& id) {
    ids_.push_back({std::hash<std::string>()(id), index});
  }

  // Throws std::runtime_error that names the first candidate whose id an earlier one has.
  void require(const CandidateList& candidates) {
    std::sort(ids_.begin(), ids_.end());
    std::optional<std::string> repeated;
    std::size_t first = candidates.size();  // place of `repeated`
    for (std::size_t i = 1; i < ids_.size(); ++i) {
      for (std::size_t j = i; j > 0 && ids_[j - 1].hash == ids_[i].hash && ids_[i].index < first; --j) {
        std::string id = candidates.at(ids_[i].index).record.id;
        if (candidates.at(ids_[j - 1].index).record.id != id) continue;
        repeated = std::move(id);
        first = ids_[i].index;
      }
    }
    if (!repeated) return;
    throw std::runtime_error(
        fmt::format("the sample id {} occurs twice; ids must be unique within a build", *repeated));
  }

 private:
  struct Hashed {
    std::uint64_t hash = 0;
    std::size_t index = 0;
    auto operator<=>(const Hashed&) const = default;
  };
  std::deque<Hashed> ids_;
};

std::string note_of(const Corrections& corrections, const std::filesystem::path& file) {
  return fmt::format(
      "corrections {}: the keypoints of {} candidates are replaced; {} of its ids are no candidate's",
      manifests::valid_utf8(file.filename().string()), corrections.matched,
      corrections.points.size() - corrections.matched);
}

// Fails a record without the label that its role requires.
void check_role(config::Role role, manifests::SampleRecord& record) {
  if (role != config::Role::truth || record.failure != Reason::none) return;
  if (record.truth && record.truth->has_pose) return;
  record.failure = Reason::pose_missing;
  record.failure_detail =
      "pose: got nothing, or zeros throughout; expected 35 rotations, since the dataset's role is \"truth\"";
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

// Digests a unit's records with the details of their failures, pictures, masks and roles, and the terms of
// its datasets.
void digest_unit(const std::vector<Candidate>& candidates, const std::map<std::string, std::string>& terms,
                 Unit& unit) {
  std::string text;
  std::map<std::string, std::string> own_terms;
  for (const Candidate& candidate : candidates) {
    text += manifests::record_digest(candidate.record) + ' ' + candidate.image_sha256 + ' ' +
            candidate.mask_sha256 + ' ';
    text += std::string(to_string(candidate.role)) + '\n';
    if (!candidate.finding.empty()) text += candidate.finding + '\n';
    // verdicts.csv repeats it, so two details are two versions.
    if (candidate.record.failure != Reason::none) text += candidate.record.failure_detail + '\n';
    const auto found = terms.find(dataset_key(candidate.record));
    if (found != terms.end()) own_terms.insert(*found);
  }
  unit.input_digest = manifests::sha256(text);
  unit.label_digest = own_terms.empty()
                          ? unit.input_digest
                          : manifests::sha256(unit.input_digest + '\n' + nlohmann::json(own_terms).dump());
}

std::vector<Unit> cut_units(const CandidateList& candidates, const config::BuildConfig& config) {
  const auto unit_size = static_cast<std::size_t>(config.shards.unit_size);
  const std::map<std::string, std::string> terms = texts_of_terms(config);
  std::vector<Unit> units((candidates.size() + unit_size - 1) / unit_size);
  tbb::parallel_for(std::size_t{0}, units.size(), [&](std::size_t i) {
    Unit& unit = units[i];
    unit.index = static_cast<std::int64_t>(i);
    unit.first = i * unit_size;
    unit.count = std::min(unit_size, candidates.size() - unit.first);
    if (!run::interrupted()) digest_unit(candidates.read(unit.first, unit.count), terms, unit);
  });
  run::throw_if_interrupted();
  return units;
}

// The searches that need the candidates of all datasets.
struct Searches {
  UniqueIds ids;
  Duplicates duplicates;
};

// Takes the records of one dataset, part by part, and appends them to the candidates.
class DatasetIntake {
 public:
  // Without `bodies`, records keep the file's bodies unchecked. All references must outlive this object.
  DatasetIntake(const config::DatasetConfig& options, std::unique_ptr<device::BodyMeshes> bodies,
                manifests::DigestCache& digests, Searches& searches, Ingest& ingest)
      : options_(options),
        bodies_(std::move(bodies)),
        digests_(digests),
        searches_(searches),
        ingest_(ingest) {}

  void take(std::vector<manifests::SampleRecord>&& records) {
    if (ingest_.corrections) apply_corrections(*ingest_.corrections, records);
    for (auto& record : records) check_role(options_.role, record);
    if (!bodies_) {
      std::vector<std::string> findings(records.size());
      append(std::move(records), std::move(findings));
      return;
    }
    waiting_.insert(waiting_.end(), std::make_move_iterator(records.begin()),
                    std::make_move_iterator(records.end()));
    while (const std::size_t count = records_of_one_call(waiting_)) check_and_append(count);
  }

  // Call this after all records.
  void finish(loaders::formats::Dataset& dataset) {
    if (!bodies_) return;
    check_and_append(waiting_.size());
    dataset.notes.push_back({loaders::formats::NoteKind::remark, to_note(check_)});
  }

 private:
  void check_and_append(std::size_t count) {
    const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(count);
    std::vector<manifests::SampleRecord> records(std::make_move_iterator(waiting_.begin()),
                                                 std::make_move_iterator(end));
    waiting_.erase(waiting_.begin(), end);
    BodyCheck found = check_bodies(*bodies_, options_.keypoints_3d_of_body, records);
    add(found, check_);
    append(std::move(records), std::move(found.findings));
  }

  void append(std::vector<manifests::SampleRecord>&& records, std::vector<std::string>&& findings) {
    std::vector<Candidate> candidates;
    candidates.reserve(records.size());
    for (std::size_t i = 0; i < records.size(); ++i) {
      candidates.push_back({std::move(records[i]), {}, {}, options_.role, std::move(findings[i])});
    }
    digest_pictures(candidates, digests_);
    const std::size_t first = ingest_.candidates.size();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      searches_.ids.add(first + i, candidates[i].record.id);
      searches_.duplicates.add(first + i, candidates[i]);
    }
    ingest_.candidates.append(candidates);
  }

  const config::DatasetConfig& options_;
  std::unique_ptr<device::BodyMeshes> bodies_;
  manifests::DigestCache& digests_;
  Searches& searches_;
  Ingest& ingest_;
  std::vector<manifests::SampleRecord> waiting_;  // records that wait for a full call of the body model
  BodyCheck check_;
};

void ingest_dataset(const config::DatasetConfig& options, manifests::DigestCache& digests,
                    const device::BodyMeshesLoader& load_bodies, Searches& searches, Ingest& result) {
  const bool checks_bodies = !options.body_model.empty() && load_bodies;
  DatasetIntake intake(options, checks_bodies ? load_bodies(options.body_model) : nullptr, digests, searches,
                       result);
  auto [dataset, digest] = stream_dataset(
      options, digests,
      [&](std::vector<manifests::SampleRecord>&& records) { intake.take(std::move(records)); });
  intake.finish(dataset);
  const std::string name = options.name + "/" + options.split;
  result.annotation_digests[name] = std::move(digest);
  result.files.insert(result.files.end(), dataset.files.begin(), dataset.files.end());
  if (is_rendered(options.root)) result.rendered.insert(name);
  for (auto& note : dataset.notes) result.notes.push_back({note.kind, name, std::move(note.text)});
}

}  // namespace

void digest_pictures(std::span<Candidate> candidates, manifests::DigestCache& digests) {
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

IngestedDataset stream_dataset(const config::DatasetConfig& options, manifests::DigestCache& digests,
                               const loaders::formats::TakeRecords& take) {
  PictureFit fit(options);
  const LocalFolders folders(options);
  loaders::formats::Dataset dataset =
      stream_configured(options, [&](std::vector<manifests::SampleRecord>&& records) {
        run::throw_if_interrupted();
        fit.fit(records);
        for (auto& record : records) {
          record.failure_detail = folders.without(std::move(record.failure_detail));
        }
        take(std::move(records));
      });
  for (auto& note : fit.notes()) dataset.notes.push_back(std::move(note));
  for (auto& note : dataset.notes) note.text = folders.without(std::move(note.text));
  std::string digest = digest_files(dataset.files, digests);
  return {std::move(dataset), std::move(digest)};
}

IngestedDataset read_dataset(const config::DatasetConfig& options, manifests::DigestCache& digests) {
  std::vector<manifests::SampleRecord> records;
  IngestedDataset read = stream_dataset(options, digests, [&](std::vector<manifests::SampleRecord>&& part) {
    records.insert(records.end(), std::make_move_iterator(part.begin()), std::make_move_iterator(part.end()));
  });
  read.dataset.records = std::move(records);
  return read;
}

Ingest ingest(const config::BuildConfig& config, manifests::DigestCache& digests,
              const device::BodyMeshesLoader& load_bodies, const std::filesystem::path& folder) {
  Ingest result;
  result.candidates = CandidateList(folder);
  if (!config.corrections.empty()) result.corrections = read_corrections(config.corrections);
  std::optional<Searches> searches(std::in_place);
  for (const auto& options : config.datasets) {
    run::throw_if_interrupted();
    ingest_dataset(options, digests, load_bodies, *searches, result);
  }
  if (result.corrections) {
    result.notes.push_back(
        {loaders::formats::NoteKind::remark, {}, note_of(*result.corrections, config.corrections)});
  }
  searches->ids.require(result.candidates);
  searches->duplicates.fail(result.candidates, result.notes);
  searches.reset();  // frees their memory
  digests.save();
  result.units = cut_units(result.candidates, config);
  return result;
}

}  // namespace q3d::pipeline::candidates
