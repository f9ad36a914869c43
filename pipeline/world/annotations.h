// The annotation files in the datasets' own formats (docs/datasets.md says where each field was read).
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "pipeline/world/picture.h"
#include "pipeline/world/plan.h"

namespace q3d::pipeline::world {

// A plan and what became of it.
struct FinishedPicture {
  PicturePlan plan;
  PictureTruth truth;
};

// PRIMA/AniMer records with 3D truth: {"info", "data": [...]}.
nlohmann::json prima_annotations(std::span<const FinishedPicture> pictures, const std::string& info);

// COCO with SuperAnimal's 39 keypoints: {"images", "annotations", "categories"}.
nlohmann::json superanimal_annotations(std::span<const FinishedPicture> pictures,
                                       const std::vector<Landmark>& landmarks);

// Animal Kingdom's MPII-style list (protocol 3, mammals).
nlohmann::json animal_kingdom_annotations(std::span<const FinishedPicture> pictures);

// Returns all that is true of pictures whose annotation file says less: {"pictures": {<image as listed>:
// {...}}}. Keypoints are SMAL's 26: pixels with v = 1 inside the picture (hidden or not), else 0; 3D in the
// camera frame without translation.
nlohmann::json truth_annotations(std::span<const FinishedPicture> pictures);

}  // namespace q3d::pipeline::world
