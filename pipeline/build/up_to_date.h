// Says whether a build has nothing to do, without reading its inputs.
//
// A build that ends with a finished dataset leaves a record, <out>/stages/builds/<digest of the
// request>.stamps: the stamps of everything that it read (pictures, masks, annotation files, weights, the
// program itself), of every folder in which a picture could appear, and of the dataset's own files, at the
// moment when their bytes were compared with their digests. As long as all stamps are the same, the same
// request would end with the same dataset.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/path_table.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"
#include "pipeline/config/judging_rules.h"

namespace q3d::pipeline::build {

class UpToDateRecord {
 public:
  // The record of the request that this config makes on this device. Later calls refer to the state at the
  // time of construction or before.
  UpToDateRecord(const std::filesystem::path& out, const config::BuildConfig& config,
                 const config::JudgingRules& rules, const std::string& device_key);

  struct Unchanged {
    std::filesystem::path folder;  // of the finished dataset
    std::vector<candidates::IngestNote> notes;
    std::int64_t candidates = 0;
    std::int64_t units = 0;
  };
  // Returns the result of the request if nothing has changed. A damaged record counts as none. Throws
  // manifests::IoError.
  std::optional<Unchanged> unchanged() const;

  // Stores the stamps, if they can be trusted, which means that no input was changed since this object was
  // made. A build whose datasets are compared with test sets has no record. `folder` holds the finished
  // dataset; its bytes were just compared or written. Throws manifests::IoError.
  void keep(const candidates::Ingest& ingest, const std::filesystem::path& folder) const;

 private:
  std::optional<manifests::PathTable> inputs(const candidates::Ingest& ingest) const;

  std::filesystem::path out_;
  const config::BuildConfig& config_;
  std::string request_;  // digest
  std::int64_t begun_ns_ = 0;
};

}  // namespace q3d::pipeline::build
