// What COCO-style files share: images that annotations point to, keypoints named by a category, and the two
// ways of writing boxes.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>

#include "loaders/formats/formats.h"
#include "loaders/keypoints/topology.h"

namespace q3d::loaders::formats {

// What a format adds to a sample whose picture, box and 26 keypoints have been read.
using CocoAddition =
    std::function<void(Loading& loading, RecordReader& annotation, manifests::SampleRecord& sample)>;

struct CocoRules {
  CocoAddition add;
  // Called with an annotation's keypoints in the topology's order, before they become 26.
  std::function<void(std::span<manifests::Keypoint> keypoints)> weigh{};
  // Where an annotation has no box: one around its keypoints (box_around). Without a margin it fails.
  std::optional<double> box_margin{};
};

// All annotations in file order. Keypoints are taken by the names that the categories list, in whatever
// order. Boxes are read as the majority of the file tells (vote_on_boxes), then checked. `images` is COCO's
// list, or an object from id to file name. Throws std::runtime_error when images or annotations are missing,
// two categories list different keypoints, or their names are not the topology's.
Dataset load_coco(const nlohmann::json& document, const keypoints::Topology& topology, Loading& loading,
                  const CocoRules& rules);

}  // namespace q3d::loaders::formats
