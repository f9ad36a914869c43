// Draws a picture that shows which keypoints are left and which are right.
#pragma once

#include <filesystem>
#include <vector>

#include "loaders/keypoints/topology.h"
#include "manifests/sample.h"

namespace q3d::pipeline::report {

// Writes a PNG grid with a tile for each record: its picture around its box, with the labelled keypoints that
// are among the 26, under the names that the topology's files use. Left is blue, right is orange, and the
// middle of the body is white. Throws std::runtime_error if a picture cannot be decoded or the file cannot be
// written.
void write_label_sheet(const std::filesystem::path& path, const std::vector<manifests::SampleRecord>& records,
                       const loaders::keypoints::Topology& topology);

}  // namespace q3d::pipeline::report
