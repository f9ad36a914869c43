// What COCO-style files share: images that annotations point to, keypoints named by a category, and the two
// ways of writing boxes.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "loaders/formats.h"
#include "loaders/topology.h"

namespace q3d::loaders {

// What a format adds to a sample whose picture, box and 26 keypoints have been read.
using CocoAddition = void (*)(Loading& loading, RecordReader& annotation, manifests::SampleRecord& sample);

// All annotations in file order. Keypoints are taken by the names that a category lists, in whatever order.
// Boxes are read as the majority of the file tells (vote_on_boxes), then checked. Throws std::runtime_error
// when images or annotations are missing, or the keypoints' names are not the topology's.
Dataset load_coco(const nlohmann::json& document, const Topology& topology, Loading& loading,
                  CocoAddition add);

}  // namespace q3d::loaders
