// Converts a sample to the JSON record of another project's format. docs/export.md describes every field.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <string>

#include "manifests/shard.h"
#include "pipeline/exports/picture.h"

namespace q3d::pipeline::exports {

// The paths of a sample's pictures, relative to the folder that the reader joins them to. A path is empty if
// there is no picture.
struct PictureNames {
  std::string image;
  std::string mask;
};

// Returns one element of `data` in the JSON of PRIMA and AniMer. Keys of a label that the sample does not
// have are left out, since the official code takes their absence for "no label": keypoint_3d, pose, shape,
// shape_extra, trans. A keypoint that is not labelled is [0, 0, 0]; a labelled one has the annotation's v.
nlohmann::ordered_json prima_record(const manifests::ShardSample& sample, const ExportedPicture& picture,
                                    const PictureNames& names);

// The ids by which a COCO file's three lists refer to each other.
struct CocoIds {
  std::int64_t image = 0;
  std::int64_t annotation = 0;
  std::int64_t category = 0;
};

// These return elements of `images`, `annotations` and `categories`. An image says under "quadruped3d" which
// sample it shows and how the source picture maps to it. The annotation's "attributes" describe its label. v
// is 0, 1 or 2; a confidence above 0 becomes 2 and is kept in the attributes.
nlohmann::ordered_json coco_image(const manifests::ShardSample& sample, const ExportedPicture& picture,
                                  const std::string& file_name, std::int64_t id);
nlohmann::ordered_json coco_annotation(const manifests::ShardSample& sample, const ExportedPicture& picture,
                                       const CocoIds& ids);
// Returns the category of a species, or "animal" if it is unknown, with the 26 keypoints' names and bones.
nlohmann::ordered_json coco_category(const std::string& species, manifests::Family family, std::int64_t id);

}  // namespace q3d::pipeline::exports
