// `export`: writes a finished dataset in another project's format.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace q3d::pipeline::exports {

enum class Format { prima, coco };

struct ExportOptions {
  Format format = Format::prima;
  std::filesystem::path out;
  bool pictures_anyway = false;  // export pictures also of datasets that state no licence
  int threads = 0;               // threads that make pictures; 0 = all cores. Changes no byte
  bool quiet = false;
};

struct ExportSummary {
  std::int64_t samples = 0;
  std::int64_t pictures = 0;
  std::vector<std::string> without_licence;  // "name/split" of datasets whose pictures were left out
  std::vector<std::string> files;            // annotation files and metadata, relative to the folder
  bool was_complete = false;                 // an earlier run had finished it
};

// Writes the newest or the given version of a dataset into options.out. docs/export.md describes the files. A
// new run after a stopped one makes only the missing units; the bytes are the same.
//
// Samples of a dataset without a stated licence, and of shards without pictures, keep the pixel coordinates
// of the source's own picture and name that picture.
//
// Throws std::runtime_error for a dataset that cannot be read, run::ConfigError if the folder holds something
// else, and Interrupted.
ExportSummary export_dataset(const std::filesystem::path& dataset, const ExportOptions& options);

}  // namespace q3d::pipeline::exports
