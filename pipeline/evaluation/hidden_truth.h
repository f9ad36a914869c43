// The hidden truth holds facts about pictures that their annotation file leaves out. It is read for
// evaluation only, never for training. docs/synthetic-world.md describes the file, which the synthetic world
// writes beside its 2D-only sets.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/sample.h"

namespace q3d::pipeline::evaluation {

struct PictureTruth {
  std::string species;
  manifests::Family family = manifests::Family::none;
  manifests::BodyTruth body;
  manifests::Keypoints keypoints{};  // projections of the body, image px; weight 1 inside the picture
  std::string mask_path;  // absolute; empty when the file names none or no folder of masks is given
};

class HiddenTruth {
 public:
  // Reads one file: {"pictures": {<name as the annotation file lists it>: {...}}}. Mask paths are relative to
  // `masks`; without that folder they are left out. Throws std::runtime_error that names file, picture and
  // field, what was found and what was expected.
  HiddenTruth(const std::filesystem::path& file, const std::filesystem::path& masks);

  const PictureTruth* find(const std::string& listed_name) const;  // null when it is not there
  std::size_t size() const { return pictures_.size(); }

  // Sets true body, species, family and mask of the records of these pictures. Returns how many records have
  // no truth here. The file has one animal for each picture, so this throws std::runtime_error if two records
  // share a picture.
  std::size_t complete(std::vector<manifests::SampleRecord>& records) const;

 private:
  std::filesystem::path file_;
  std::map<std::string, PictureTruth> pictures_;
};

}  // namespace q3d::pipeline::evaluation
