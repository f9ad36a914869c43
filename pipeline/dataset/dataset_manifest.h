// The finished dataset's own files: dataset.json (what it is and where it came from) and verdicts.csv (what
// became of every candidate).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/verdict.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::dataset {

inline constexpr const char* kDatasetFormat = "quadruped3d-dataset";

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
};

// What a reader needs of dataset.json.
struct DatasetManifest {
  std::string name;
  std::string version;
  std::string key;         // 64 hex digits: the config, the code, the assets and the pictures
  std::string content_id;  // SHA-256 over the ordered shard digests
  int schema = 0;
  Counts counts;
  std::map<std::string, std::int64_t> labels;  // kept samples by kind of label: truth, retained, ...
  std::vector<ShardEntry> shards;
  std::string verdicts_sha256;
  std::map<std::string, std::int64_t> reasons;  // of the discarded and the failed
};

// SHA-256 over the shards' digests, one a line, in unit order.
std::string content_id(const std::vector<ShardEntry>& shards);

struct DatasetInputs {
  const config::BuildConfig* config = nullptr;
  const config::JudgingRules* rules = nullptr;
  const candidates::Ingest* ingest = nullptr;
  const stages::AssetDigests* assets = nullptr;
  const stages::StageKeys* keys = nullptr;
  std::string device_key;
};

// Text of dataset.json: no time, host or absolute path of its own, so equal builds give equal bytes.
std::string dataset_json(const DatasetInputs& inputs, const std::vector<manifests::Judgement>& judgements,
                         const std::vector<ShardEntry>& shards, const std::string& verdicts_sha256);

// Text of verdicts.csv: a header and one line a candidate in ingest order. Shard and row are those of the
// kept ones.
std::string verdicts_csv(const candidates::Ingest& ingest,
                         const std::vector<manifests::Judgement>& judgements);

// Reads dataset.json of a dataset's folder, or of the newest one (`latest`) of an output folder.
// Throws std::runtime_error naming file, key, got and expected.
DatasetManifest read_dataset_manifest(const std::filesystem::path& folder);
// The folder itself, or its `latest`. Throws std::runtime_error when neither holds a dataset.json.
std::filesystem::path dataset_folder(const std::filesystem::path& given);

}  // namespace q3d::pipeline::dataset
