// Annotation files -> sample records.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "manifests/sample.h"

namespace q3d::loaders {

struct DatasetOptions {
  std::string name;            // becomes the first part of every sample id
  std::string format;          // one of dataset_formats()
  std::string split;           // second part of every sample id
  std::filesystem::path root;  // pictures and masks are looked up below this folder, and never outside it
  std::filesystem::path annotations;  // JSON file; relative to root unless absolute
  std::filesystem::path images;       // SuperAnimal, Animal Kingdom: folder of the pictures, relative to root
};

struct Dataset {
  std::vector<manifests::SampleRecord>
      records;                     // file order; records that cannot be used carry their failure
  std::vector<std::string> notes;  // what a user should know (boxes read as xyxy, ...)
};

std::vector<std::string> dataset_formats();  // "prima", "superanimal", "animal_kingdom"

// Throws std::runtime_error naming file, record, field, got and expected when the file as a whole cannot be
// read (cut short, wrong top-level type); a bad record is returned with its failure instead.
Dataset load_dataset(const DatasetOptions& options);

}  // namespace q3d::loaders
