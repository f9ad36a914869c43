// Draws a picture of a dataset's samples: crops with the labelled bodies and the annotated keypoints.
#pragma once

#include <filesystem>

#include "pipeline/device/body_meshes.h"

namespace q3d::pipeline::report {

struct SheetOptions {
  std::filesystem::path path;  // a dataset's folder, an output folder, or one shard
  std::filesystem::path out;   // PNG
  std::filesystem::path body;  // body model; empty: the one that the dataset was made with
  int count = 24;              // samples, spread evenly over the rows
  int columns = 6;
};

// Writes a PNG grid with a legend. Each cell shows a sample's label as a mesh, the annotated keypoints, the
// keypoints of the label, and below them the whole id and the errors. If no body model is found, the meshes
// are left out and a note says so. Throws std::runtime_error if the shards hold no pictures or the file
// cannot be written.
void write_contact_sheet(const SheetOptions& options, const device::BodyMeshesLoader& load_bodies);

}  // namespace q3d::pipeline::report
