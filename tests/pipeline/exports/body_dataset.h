// A small published dataset with pictures and bodies, sound to the last check of `verify`.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "manifests/shard.h"

namespace q3d::testing {

struct BodyDataset {
  std::filesystem::path folder;
  nlohmann::json document;  // of dataset.json
  std::vector<manifests::ShardSample> samples;

  void write_document() const;  // dataset.json anew, after a change of `document`
};

// Writes <out>/<name>-000000000000 with a shard of four samples for each of `shards`, whose samples are
// zoo/train/<shard>_<i>.jpg#<i>, and one discarded candidate, zoo/train/<name>_bad.jpg#9.
BodyDataset make_body_dataset(const std::filesystem::path& out, const std::string& name,
                              const std::vector<std::string>& shards, unsigned seed);

}  // namespace q3d::testing
