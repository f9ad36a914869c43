// Declares one parser for each format and the parts that they share. load_dataset chooses the parser.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "loaders/formats/dataset.h"
#include "loaders/formats/notes.h"
#include "loaders/formats/picture_finder.h"
#include "loaders/formats/record_reader.h"
#include "loaders/species/species.h"

namespace q3d::loaders::formats {

Dataset stream_prima(const DatasetOptions& options, const TakeRecords& take);
Dataset load_superanimal(const DatasetOptions& options);
Dataset load_animal_kingdom(const DatasetOptions& options);
Dataset load_stanford_extra(const DatasetOptions& options);
Dataset load_badja(const DatasetOptions& options);
Dataset load_coco_labels(const DatasetOptions& options);
Dataset load_deeplabcut(const DatasetOptions& options);
Dataset load_photographs(const DatasetOptions& options);

// The state of a parser while it reads one file.
struct Loading {
  Loading(const DatasetOptions& dataset_options, const std::filesystem::path& default_images);

  const DatasetOptions& options;
  std::filesystem::path file;                       // the annotation file
  std::vector<std::filesystem::path> more_files{};  // other files that were read
  PictureFinder finder;
  Notes notes;
};

// A picture's name and the field that states it.
struct PictureName {
  std::string name;
  std::string field;
};

// Sets dataset, split, id and picture of a sample. The picture is that of the first name that leads to one;
// the first name of all is part of the id. `annotation` is the last part of the id.
void set_picture(Loading& loading, RecordReader& reader, const std::vector<PictureName>& names,
                 const std::string& annotation, manifests::SampleRecord& sample);
// Sets the same from a picture that was looked for already.
void set_found_picture(Loading& loading, RecordReader& reader, const PictureName& name,
                       const FoundPicture& found, const std::string& annotation,
                       manifests::SampleRecord& sample);

// Notes keypoints that are labelled but lie where tools put points that nobody set (is_placeholder).
void note_placeholders(Loading& loading, std::span<const manifests::Keypoint> keypoints,
                       const manifests::SampleRecord& sample);

// Notes that a sample's box was made around its keypoints with this margin (box_around).
void note_made_box(Loading& loading, double margin, const manifests::SampleRecord& sample);

// Reads a record's box. If none is stated, it is made around these keypoints with the margin of the dataset's
// options, with a note; without a visible keypoint the record fails with `box_missing`.
manifests::Box read_or_make_box(Loading& loading, RecordReader& reader, const std::string& field,
                                std::span<const manifests::Keypoint> keypoints,
                                const manifests::SampleRecord& sample);

// These fail samples whose box has no area or lies outside the image, and samples without a visible keypoint.
void check_box(RecordReader& reader, const std::string& field, const manifests::SampleRecord& sample);
void check_visible(RecordReader& reader, const std::string& field, const manifests::SampleRecord& sample);

// Sets the family: the one that the file states, else the table's (`from_table`). Notes unknown species and
// disagreements between the two.
void set_family(Loading& loading, std::optional<manifests::Family> stated,
                std::optional<manifests::Family> from_table, manifests::SampleRecord& sample);

// Shortens the texts of records, because a hostile file may make them arbitrarily long.
void bound_texts(std::vector<manifests::SampleRecord>& records);

// Bounds the records' texts, appends the finder's notes and returns the result.
Dataset finished(Loading& loading, std::vector<manifests::SampleRecord> records);

}  // namespace q3d::loaders::formats
