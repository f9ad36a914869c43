// A picture of what a dataset holds: crops with annotated keypoints and the projected body.
#pragma once

#include <filesystem>
#include <vector>

#include "manifests/shard.h"

namespace q3d::pipeline::report {

// Writes a PNG grid of the network's crops. Green discs: annotated visible keypoints; red crosses joined to
// them: where the labelled body's keypoints project, where there is a body. Throws std::runtime_error when
// the shard holds no pictures or the file cannot be written.
void write_contact_sheet(const std::filesystem::path& path,
                         const std::vector<manifests::ShardSample>& samples, int columns = 6);

}  // namespace q3d::pipeline::report
