// The list of a dataset's exports, which may lie in any folder. `status` shows it.
//
// Each export has a file in <out>/stages/exports. No result depends on these files, and they are no part of a
// dataset.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/dataset/published_dataset.h"

namespace q3d::pipeline::dataset {

struct ListedExport {
  std::string format;            // "prima", "coco", "parquet" or "hf"
  std::string version;           // name of the dataset's folder
  std::string content_id;        // of the dataset
  bool pictures_anyway = false;  // the option of this name
  std::filesystem::path folder;  // relative to the output folder
};

// Adds an export of the dataset into `folder` to the list. If the list cannot be written, as below a dataset
// on a read-only disk, a note says so.
void list_export(const PublishedDataset& dataset, const std::string& format, bool pictures_anyway,
                 const std::filesystem::path& folder);

enum class ExportState : std::uint8_t {
  complete,    // its manifest exists, and every file that it lists has the listed size
  damaged,     // its manifest exists, but files are gone or have another size
  unfinished,  // the same `export` command continues it
  gone         // the folder does not exist, or holds something else now
};

struct ExportStatus {
  ListedExport listed;
  std::string key;  // 64 hex digits: the SHA-256 of what decides the export's bytes; empty if it is gone
  ExportState state = ExportState::gone;
  std::vector<std::string> damaged;  // files
};

// Returns the list in the order of format and folder. Reads the manifests of the exports, and changes
// nothing. A file that holds no entry is left out, and a warning names it. Throws manifests::IoError.
std::vector<ExportStatus> listed_exports(const std::filesystem::path& out);

}  // namespace q3d::pipeline::dataset
