// The finished dataset's own files: dataset.json (what it is and where it came from) and verdicts.csv (what
// became of every candidate).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "filters/fidelity.h"
#include "manifests/dataset_document.h"
#include "manifests/shard.h"
#include "manifests/verdict.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"
#include "pipeline/dataset/warnings.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::dataset {

using manifests::kDatasetFormat;

struct ShardEntry {
  std::string file;  // relative to the dataset's folder
  std::string sha256;
  std::int64_t bytes = 0;
  std::int64_t rows = 0;
  std::int64_t unit = 0;
};

struct Counts {
  std::int64_t candidates = 0;
  std::int64_t retained = 0;
  std::int64_t refined = 0;
  std::int64_t discarded = 0;
  std::int64_t failed = 0;
  void add(manifests::Verdict verdict);
  bool operator==(const Counts&) const = default;
};

// Counts the candidates of one group, which is a dataset, a family, a species or the whole dataset.
struct GroupStatistics {
  Counts counts;
  // Mean L_proj of the kept candidates before and after refinement, in crop units (crop side = 1). Absent if
  // it was computed for none of them.
  std::optional<double> mean_initial_error;
  std::optional<double> mean_final_error;
};

// The content of dataset.json that readers need.
struct DatasetManifest {
  std::string name;
  std::string version;
  std::string key;         // 64 hex digits: the config, the code, the assets and the pictures
  std::string content_id;  // SHA-256 over the ordered shard digests
  std::string toolkit;     // version of the toolkit that wrote it
  std::string profile;
  int schema = 0;
  Counts counts;
  std::map<manifests::LabelKind, std::int64_t> labels;  // number of kept samples by kind of label
  std::map<manifests::Reason, std::int64_t> reasons;    // number of discarded and failed ones by reason
  GroupStatistics all;
  std::map<std::string, GroupStatistics> by_dataset;  // by "name/split"
  std::map<manifests::Family, GroupStatistics> by_family;
  std::map<std::string, GroupStatistics> by_species;        // "unknown" where the file names none
  std::map<std::string, filters::Thresholds> thresholds;    // by dataset, of those with pseudo labels
  std::map<std::string, config::Role> roles;                // by "name/split"
  std::map<std::string, manifests::DatasetTerms> terms;     // by "name/split"; empty in schema 1
  std::size_t unit_size = config::ShardConfig{}.unit_size;  // candidates of one unit, and so of one shard
  stages::StageKeys keys;                                   // `measure` is empty when no bound was on
  std::string checkpoint_sha256;                            // empty, like the two below, without a network
  std::string smal_asset_sha256;
  std::string device;
  std::vector<ShardEntry> shards;
  std::string verdicts_sha256;
  std::vector<Warning> warnings;  // reasons why the labels may be worth little
};

// Returns the terms that the config states for its datasets, by "name/split".
std::map<std::string, manifests::DatasetTerms> terms_of_datasets(const config::BuildConfig& config);

// Returns the SHA-256 over the shards' digests, one on each line, in unit order.
std::string content_id(const std::vector<ShardEntry>& shards);

// Counts the candidates and their verdicts for dataset.json.
class VerdictBooks {
 public:
  // Takes the candidates one by one, in their order.
  void add(const candidates::Candidate& candidate, const manifests::Judgement& judgement);

  const Counts& counts() const { return counts_; }
  nlohmann::ordered_json labels_json() const;
  nlohmann::ordered_json statistics_json() const;

 private:
  struct Mean {  // mean of the errors that were computed
    double sum = 0.0;
    std::int64_t count = 0;
    void add(double error);
    double value() const { return sum / static_cast<double>(count); }
  };
  struct Group {
    Counts counts;
    Mean initial;
    Mean final;
    void add(const manifests::Judgement& judgement);
  };
  using Groups = std::map<std::string, Group>;
  static nlohmann::ordered_json to_json(const Groups& groups);

  Counts counts_;
  std::map<manifests::LabelKind, std::int64_t> labels_;
  std::map<std::string, std::int64_t> reasons_;
  Group all_;
  Groups by_dataset_;
  Groups by_family_;
  Groups by_species_;
};

struct DatasetInputs {
  const config::BuildConfig* config = nullptr;
  const config::JudgingRules* rules = nullptr;
  const candidates::Ingest* ingest = nullptr;
  const stages::AssetDigests* assets = nullptr;
  const stages::StageKeys* keys = nullptr;
  std::string device_key;
  std::vector<Warning> warnings{};
};

// Returns a list of {kind, dataset, text}. `dataset` is null if a note concerns the whole pool.
nlohmann::ordered_json notes_json(const std::vector<candidates::IngestNote>& notes);

// Returns the text of dataset.json, which ends with a digest over itself (manifests/sealed_json.h). The
// function adds no time, host or absolute path, so equal builds give equal bytes.
std::string dataset_json(const DatasetInputs& inputs, const VerdictBooks& books,
                         const std::vector<ShardEntry>& shards, const std::string& verdicts_sha256);

// Reads dataset.json of a dataset's folder, or of the newest one (`latest`) of an output folder. Throws
// std::runtime_error that names the file, what was found and what was expected, also for a name that is no
// enumerator's and for a shard outside the folder `shards`. Also throws as read_dataset_document does.
DatasetManifest read_dataset_manifest(const std::filesystem::path& given);
// Returns the whole document without its digest. Throws like manifests::read_dataset_document.
nlohmann::ordered_json read_dataset_document(const std::filesystem::path& given);
// Returns the folder itself, or its `latest`. Throws std::runtime_error if neither holds a dataset.json.
std::filesystem::path dataset_folder(const std::filesystem::path& given);

}  // namespace q3d::pipeline::dataset
