// The interface of an export format, which defines the names of pictures, the records, and the files that are
// made from them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "manifests/shard.h"
#include "pipeline/exports/croissant.h"
#include "pipeline/exports/export_dataset.h"
#include "pipeline/exports/export_folder.h"
#include "pipeline/exports/picture.h"

namespace q3d::pipeline::exports {

// A sample and its place in the dataset.
struct ExportedSample {
  const manifests::ShardSample& sample;
  const ExportedPicture& picture;
  std::int64_t unit = 0;
  std::int64_t row = 0;
};

// A file of a picture or mask, relative to the export's folder.
struct PictureFile {
  std::string name;
  const std::vector<std::byte>* bytes = nullptr;
};

// All functions but assemble() are thread-safe.
class FormatWriter {
 public:
  virtual ~FormatWriter() = default;
  // Returns the kind of picture that the format needs, where pictures may be exported.
  virtual Pictures pictures() const = 0;
  // Returns the files of the sample's picture, or nothing if it has no picture.
  virtual std::vector<PictureFile> picture_files(const ExportedSample& exported) const = 0;
  // Returns the sample's part of the unit's records, as lines that end in line feeds.
  virtual std::string lines(const ExportedSample& exported) const = 0;
  // Takes the records of the next unit; units come in order.
  virtual void take(const std::string& lines) = 0;
  // Writes the annotation files. Returns their description for croissant.json.
  virtual std::vector<CroissantRecords> assemble(ExportFolder& folder) = 0;
  virtual std::vector<std::string> picture_patterns() const = 0;
};

// The facts about the whole dataset that a writer knows before it sees the samples.
struct ExportedDataset {
  std::string title;       // "name version (folder)"
  std::string content_id;  // of the dataset
  std::string suffix;      // of the pictures: "jpg" or "png"
  std::size_t unit_size = 0;
  // The species of the samples, sorted by name. Each has the family of its first sample. The empty name
  // stands for an unknown species.
  std::vector<std::pair<std::string, manifests::Family>> species;
};

std::unique_ptr<FormatWriter> make_prima_writer(ExportedDataset dataset);
std::unique_ptr<FormatWriter> make_coco_writer(ExportedDataset dataset);

}  // namespace q3d::pipeline::exports
