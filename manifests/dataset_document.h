// The checks that every reader of a dataset.json makes before it uses a value.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace q3d::manifests {

inline constexpr const char* kDatasetFormat = "quadruped3d-dataset";

// Reads a whole dataset.json and compares it with the digest at its end. The result is without the digest.
// Throws DamagedDocument (manifests/sealed_json.h) that names the file if it is not as it was written: it is
// no readable JSON, has another digest, or lacks one although its schema is above 1. Throws IoError if it
// cannot be read.
nlohmann::ordered_json read_dataset_document(const std::filesystem::path& file);

// Returns the name of a shard in dataset.json, "shards/<file>.h5". The named file is opened, so the name must
// not lead out of the dataset's folder. Throws std::runtime_error for any other value.
std::string shard_name(const nlohmann::ordered_json& value);

struct ListedShard {
  std::string file;  // relative to the dataset's folder
  std::string sha256;
};

// Returns the shards that a dataset.json lists, in its order. Throws std::runtime_error that names the file,
// and as read_dataset_document does.
std::vector<ListedShard> read_listed_shards(const std::filesystem::path& file);

}  // namespace q3d::manifests
