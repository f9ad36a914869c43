// Makes the annotation files in the datasets' own formats. docs/datasets.md gives the source of each field.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "pipeline/world/picture.h"
#include "pipeline/world/plan.h"

namespace q3d::pipeline::world {

// A plan and the picture that was made from it.
struct FinishedPicture {
  PicturePlan plan;
  PictureTruth truth;
};

// Returns PRIMA/AniMer records with 3D truth: {"info", "data": [...]}.
nlohmann::json prima_annotations(std::span<const FinishedPicture> pictures, const std::string& info);

// Returns COCO with SuperAnimal's 39 keypoints: {"images", "annotations", "categories"}.
nlohmann::json superanimal_annotations(std::span<const FinishedPicture> pictures,
                                       const std::vector<Landmark>& landmarks);

// Returns Animal Kingdom's MPII-style list (protocol 3, mammals).
nlohmann::json animal_kingdom_annotations(std::span<const FinishedPicture> pictures);

// Returns the full truth about pictures whose annotation file holds only a part of it: {"pictures": {<image
// as listed>: {...}}}. Keypoints are SMAL's 26: pixels with v = 1 inside the picture (hidden or not), else 0;
// 3D in the camera frame without translation.
nlohmann::json truth_annotations(std::span<const FinishedPicture> pictures);

}  // namespace q3d::pipeline::world
