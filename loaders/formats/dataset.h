// Loads annotation files as sample records.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "loaders/formats/note.h"
#include "manifests/sample.h"

namespace q3d::loaders::formats {

struct DatasetOptions {
  std::string name;             // becomes the first part of every sample id
  std::string format;           // one of dataset_formats()
  std::string split = "train";  // second part of every sample id
  std::filesystem::path root;   // pictures and masks are looked up below this folder, and never outside it
  std::filesystem::path annotations;  // JSON file; relative to root unless absolute
  // Folder of the pictures, relative to root unless it is absolute. If the user names a folder outside the
  // root, pictures may lie there. If it is empty, the format's own folder is used: root (prima), root/images
  // (superanimal), root/dataset (animal_kingdom), or root if that folder does not exist.
  std::filesystem::path images;

  // The following options belong to the formats that take a topology (takes_topology).
  // A JSON file that names the keypoints, or the name of a built-in topology
  // (loaders/keypoints/topology_file.h); required.
  std::filesystem::path topology{};
  std::vector<std::string> categories{};  // "coco": names of the categories to take; empty takes all
  std::string species{};  // species of all animals; if empty, it comes from the file, if the file states it
  double min_confidence = 0.6;  // keypoints with less confidence get weight 0 (DeepLabCut's p-cutoff)
  double box_margin = 0.1;      // a box made from keypoints is enlarged by this share of its longer side
  // "deeplabcut", rows that are frame numbers: the number of the picture that shows frame 0. Without it, the
  // pictures must have the rows' own numbers.
  std::optional<int> first_frame{};
};

struct Dataset {
  std::vector<manifests::SampleRecord> records;  // file order; unusable records carry their failure
  std::vector<Note> notes;                       // remarks for the user (boxes read as xyxy, ...)
  std::vector<std::filesystem::path> files;      // files that were read, except pictures
};

// Returns the names of the formats.
//
// - "prima": the JSON of PRIMA and AniMer (Animal3D, CtrlAni3D and sets converted to it).
// - "superanimal": SuperAnimal-Quadruped's COCO file with 39 keypoints.
// - "animal_kingdom": its list of records with 23 keypoints, or its COCO file, told apart by content.
// - "stanfordextra": StanfordExtra's list of dogs with 24 keypoints, or the first 20 of them.
// - "badja": BADJA's joint annotations of a video, or a folder of such files.
// - "coco": any other COCO keypoints, described by a topology file (AP-10K, AnimalPose, a lab's own).
// - "deeplabcut": DeepLabCut's .h5 and .csv, labels and predictions; `annotations` is one of these files, or
//   the folder of a project with its CollectedData files.
// - "sleap": SLEAP's .slp, analysis .h5 and analysis .csv of one video.
// - "lightning_pose": Lightning Pose's labels and predictions as .csv.
// The last three differ in name alone: each reads the files of the others too.
std::vector<std::string> dataset_formats();

// Returns true for the formats whose keypoints a topology describes.
bool takes_topology(const std::string& format);

// Loads a dataset. Sample ids are name/split/picture#annotation. The annotation is its id if all ids in the
// file are distinct, else its index. A record whose picture has a name that is not UTF-8 fails as
// record_malformed; ids, details and notes have its bytes written out (manifests/valid_utf8.h).
//
// Throws std::invalid_argument for options that make no sense. Throws std::runtime_error that names the file
// and the place, what was found and what was expected, if the file as a whole cannot be read (absent, cut
// short, wrong top-level type, keypoint names of another dataset). A bad record does not throw; it is
// returned with its failure.
Dataset load_dataset(const DatasetOptions& options);

// Takes the next records of a dataset, in file order.
using TakeRecords = std::function<void(std::vector<manifests::SampleRecord>&&)>;
inline constexpr std::size_t kRecordsAtOnce = 1024;

// The same for datasets of any length: gives `take` the records in parts of at most kRecordsAtOnce, and
// returns the dataset without them. A file of the format "prima" is read piece by piece, so that the memory
// does not depend on its length; what is wrong near its end is thrown after `take` had what stands before.
// The files of other formats are read as a whole.
Dataset stream_dataset(const DatasetOptions& options, const TakeRecords& take);

}  // namespace q3d::loaders::formats
