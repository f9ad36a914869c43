// Annotation files -> sample records.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/sample.h"

namespace q3d::loaders::formats {

struct DatasetOptions {
  std::string name;            // becomes the first part of every sample id
  std::string format;          // one of dataset_formats()
  std::string split;           // second part of every sample id
  std::filesystem::path root;  // pictures and masks are looked up below this folder, and never outside it
  std::filesystem::path annotations;  // JSON file; relative to root unless absolute
  // Folder of the pictures, relative to root unless absolute; naming one outside the root allows it. Empty is
  // the format's own: root (prima), root/images (superanimal), root/dataset (animal_kingdom), or root where
  // that folder does not exist.
  std::filesystem::path images;

  // Of the formats "coco" and "deeplabcut" alone.
  std::filesystem::path
      topology{};         // JSON file that names the keypoints (loaders/keypoints/topology_file.h); required
  std::string species{};  // of all animals; empty takes what the file tells, if anything
  double min_confidence = 0.6;  // keypoints of less confidence get weight 0 (DeepLabCut's p-cutoff)
  double box_margin = 0.1;      // a box made from keypoints is wider by this share of its longer side
};

struct Dataset {
  std::vector<manifests::SampleRecord> records;  // file order; what cannot be used carries its failure
  std::vector<std::string> notes;                // what a user should know (boxes read as xyxy, ...)
  std::vector<std::filesystem::path> files;      // what was read, besides pictures: annotations, topology
};

// "prima": the JSON of PRIMA and AniMer (Animal3D, CtrlAni3D and sets converted to it).
// "superanimal": SuperAnimal-Quadruped's 39-keypoint COCO. "animal_kingdom": its 23-keypoint list of records,
// or its COCO file, told apart by content. "coco": any other COCO keypoints, by a topology file (AP-10K,
// AnimalPose, a lab's own). "deeplabcut": DeepLabCut's .h5 and .csv, labels and predictions; `annotations` is
// one of them, or a folder of a project with its CollectedData files.
std::vector<std::string> dataset_formats();

// Sample ids are name/split/picture#annotation; the annotation is its id where the file gives distinct ones,
// else its index.
//
// Throws std::invalid_argument for options that make no sense, and std::runtime_error naming file, place, got
// and expected when the file as a whole cannot be read (absent, cut short, wrong top-level type, keypoint
// names of another dataset). A bad record is returned with its failure instead.
Dataset load_dataset(const DatasetOptions& options);

}  // namespace q3d::loaders::formats
