// Splits records in PRIMA's form that hold several animals of one picture.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

namespace q3d::loaders::formats {

// Returns whether `bbox` holds a list of boxes instead of one.
bool holds_several_animals(const nlohmann::json& record);

// Splits a record whose `bbox` holds a box for each animal into one record for each animal. `keypoint_2d`
// must hold a set of keypoints for each of them, and so must `keypoint_3d`, `pose`, `shape`, `shape_extra`
// and `trans` if they are there. `mask_path` and `supercategory` may have one value for all; a mask of
// several animals is left out. Returns nothing if the record cannot be split in this way, or holds one
// animal.
std::vector<nlohmann::json> one_record_an_animal(const nlohmann::json& record);

}  // namespace q3d::loaders::formats
