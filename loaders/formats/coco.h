// The parts that COCO-style files have in common: images that annotations point to, keypoints named by a
// category, and the two ways of writing boxes.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>

#include "loaders/formats/coco_categories.h"
#include "loaders/formats/formats.h"
#include "loaders/keypoints/topology.h"

namespace q3d::loaders::formats {

// Reads what a format adds to a sample after its picture, box and 26 keypoints have been read.
using CocoAddition = std::function<void(Loading& loading, RecordReader& annotation,
                                        const CocoCategory& category, manifests::SampleRecord& sample)>;

struct CocoRules {
  CocoAddition add;
  // This function gets an annotation's keypoints in the topology's order, before they are mapped to the 26.
  std::function<void(std::span<manifests::Keypoint> keypoints)> weigh{};
  // If an annotation has no box, one is made around its keypoints with this margin (box_around). Without a
  // margin the record fails.
  std::optional<double> box_margin{};
};

// Loads all annotations of the chosen categories in file order. Keypoints are found by the names that the
// categories list, in any order; missing ones get weight 0. Boxes are read as the majority of the file
// indicates (vote_on_boxes) and then checked. `images` is COCO's list, or an object from id to file name.
// Throws as CocoCategories does, and std::runtime_error if images or annotations are missing.
Dataset load_coco(const nlohmann::json& document, const keypoints::Topology& topology, Loading& loading,
                  const CocoRules& rules);

}  // namespace q3d::loaders::formats
