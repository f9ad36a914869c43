// One parser a format; load_dataset chooses. What they share is here too.
#pragma once

#include <filesystem>
#include <string>

#include "loaders/formats/dataset.h"
#include "loaders/formats/notes.h"
#include "loaders/formats/picture_finder.h"
#include "loaders/formats/record_reader.h"
#include "loaders/species/species.h"

namespace q3d::loaders::formats {

Dataset load_prima(const DatasetOptions& options);
Dataset load_superanimal(const DatasetOptions& options);
Dataset load_animal_kingdom(const DatasetOptions& options);
Dataset load_coco_labels(const DatasetOptions& options);
Dataset load_deeplabcut(const DatasetOptions& options);

// What a parser holds while it reads one file.
struct Loading {
  Loading(const DatasetOptions& dataset_options, const std::filesystem::path& default_images);

  const DatasetOptions& options;
  std::filesystem::path file;                       // the annotation file
  std::vector<std::filesystem::path> more_files{};  // others that were read
  PictureFinder finder;
  Notes notes;
};

// Dataset, split, id and picture of a sample. `annotation` ends the id.
void set_picture(Loading& loading, RecordReader& reader, const std::string& name, const std::string& field,
                 const std::string& annotation, manifests::SampleRecord& sample);

// Fails samples without area in their box, with a box outside the image, or without a visible keypoint.
void check_box(RecordReader& reader, const std::string& field, const manifests::SampleRecord& sample);
void check_visible(RecordReader& reader, const std::string& field, const manifests::SampleRecord& sample);

// The family: the file's own where it states one, else the table's (`from_table`); notes what is unknown and
// where the two disagree.
void set_family(Loading& loading, std::optional<manifests::Family> stated,
                std::optional<manifests::Family> from_table, manifests::SampleRecord& sample);

// Appends what the finder has to tell, and makes the result.
Dataset finished(Loading& loading, std::vector<manifests::SampleRecord> records);

}  // namespace q3d::loaders::formats
