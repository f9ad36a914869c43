// Ingest turns annotation files into the ordered list of candidates, each with the digest of its picture.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "loaders/formats/dataset.h"
#include "loaders/formats/note.h"
#include "manifests/digest.h"
#include "manifests/sample.h"
#include "pipeline/candidates/candidate_list.h"
#include "pipeline/candidates/corrections.h"
#include "pipeline/candidates/veto.h"
#include "pipeline/config/build_config.h"
#include "pipeline/device/body_meshes.h"

namespace q3d::pipeline::candidates {

// A fixed run of consecutive candidates in ingest order. A build resumes unit by unit, batches never cross a
// unit, and each unit becomes one shard.
struct Unit {
  std::int64_t index = 0;
  std::size_t first = 0;  // into Ingest::candidates
  std::size_t count = 0;
  std::string input_digest;  // over the records, what is wrong with them, pictures, masks and roles
  // The same, and over the terms of the unit's datasets and what is left out: shards depend on these,
  // predictions do not.
  std::string label_digest;
};

// The result of comparing the pool with the test sets.
struct LeakageSummary {
  std::map<std::string, std::string> test_sets;  // "name/split" -> SHA-256 of its annotation files
  std::size_t test_pictures = 0;
  std::size_t excluded = 0;   // candidates
  std::size_t groups = 0;     // groups of pictures of the pool that look alike
  std::size_t in_groups = 0;  // pictures
};

// A remark for the user about a dataset, or about the whole pool.
struct IngestNote {
  loaders::formats::NoteKind kind = loaders::formats::NoteKind::remark;
  std::string dataset;  // "name/split"; empty if it concerns the pool
  std::string text;

  std::string line() const { return dataset.empty() ? text : dataset + ": " + text; }
};

struct Ingest {
  CandidateList candidates;  // dataset order of the config, then file order
  std::vector<Unit> units;
  std::map<std::string, std::string> annotation_digests;  // "name/split" -> SHA-256 of its annotation files
  std::vector<std::filesystem::path> files;               // files that were read, except pictures and masks
  std::set<std::string> rendered;                         // "name/split" of datasets that `sample` rendered
  std::vector<IngestNote> notes;
  std::optional<Corrections> corrections;  // already applied to the records

  // Set by leave_out() (pipeline/leakage/exclusions.h).
  std::optional<Veto> veto;
  std::optional<LeakageSummary> leakage;
};

// Loads every dataset, compares the labels with the pictures' headers, and digests every picture (in
// parallel; unchanged files come from the cache). A record without a pose fails if its role needs a body, and
// so does one that repeats an earlier one (duplicates.h). Throws std::runtime_error for an annotation file
// that cannot be read, manifests::IoError for a picture or mask that exists and cannot be read, and
// Interrupted. `load_bodies` is called for datasets with a body model; if it is empty, bodies are not
// checked, which suits callers that need only pictures. The candidates lie in a file without a name in
// `folder`.
Ingest ingest(const config::BuildConfig& config, manifests::DigestCache& digests,
              const device::BodyMeshesLoader& load_bodies, const std::filesystem::path& folder);

// Sets the digests of the pictures and masks of candidates that have not failed. A missing picture fails its
// candidate; a missing mask counts as no mask. Throws manifests::IoError for a file that exists and cannot be
// read, and Interrupted.
void digest_pictures(std::span<Candidate> candidates, manifests::DigestCache& digests);

// Returns whether the dataset in this folder is part of a world that `sample` rendered. If so, the folder or
// the one above it holds the world's world.json. Pictures without this mark count as photographs.
bool is_rendered(const std::filesystem::path& root);

// Returns a dataset's name and split as "name/split". This is the key of everything that is listed by
// dataset.
std::string dataset_key(const manifests::SampleRecord& record);

// One dataset as ingest reads it. If it is curated, it has the chosen records only. They were compared with
// their pictures (picture_fit.h), and this machine's paths were removed. The digest covers its annotation
// files and the choice.
struct IngestedDataset {
  loaders::formats::Dataset dataset;
  std::string annotations_sha256;
};
IngestedDataset read_dataset(const config::DatasetConfig& options, manifests::DigestCache& digests);
// Reads a dataset in parts (loaders::formats::stream_dataset). `dataset` has no records.
IngestedDataset stream_dataset(const config::DatasetConfig& options, manifests::DigestCache& digests,
                               const loaders::formats::TakeRecords& take);

}  // namespace q3d::pipeline::candidates
