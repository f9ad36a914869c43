// Whether a version's folder holds a finished and undamaged dataset.
#pragma once

#include <filesystem>
#include <string>

namespace q3d::pipeline::dataset {

// True when the folder holds a complete dataset of this key: dataset.json, and verdicts.csv and every shard
// with the digests that dataset.json lists. All of them are read, so that no damaged dataset is called up to
// date. A warning names every file that is gone or damaged. Throws std::runtime_error when the folder holds a
// dataset of another key, manifests::IoError, and Interrupted.
bool is_published(const std::filesystem::path& folder, const std::string& key);

}  // namespace q3d::pipeline::dataset
