// `verify`: reads a whole finished dataset and checks everything that can be checked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace q3d::pipeline::dataset {

// A file whose bytes differ from the recorded digest.
struct Damage {
  std::filesystem::path file;
  std::string expected;  // SHA-256; empty for a file without one: a journal or a stage's manifest
};

struct VerifySummary {
  std::filesystem::path folder;
  std::int64_t shards = 0;
  std::int64_t samples = 0;
  std::int64_t pictures = 0;          // stored crops that were decoded
  std::int64_t stage_files = 0;       // units' files of the stages that were read
  std::vector<std::string> problems;  // empty if the dataset is undamaged
  std::vector<Damage> damage;         // the problems that another copy of the file would solve
};

// Recomputes every digest from the bytes (no cache), reads every shard through its schema, decodes every
// stored crop, and checks that dataset.json, verdicts.csv and the shards agree with each other: counts, ids,
// verdicts, labels and projections; and that the dataset's folder holds nothing else. `with_stages`: also
// compares the stages of the output folder with their journals (stages::check_stages). Problems are listed,
// not thrown; throws std::runtime_error when `given` holds no dataset.json that is as it was written, and
// Interrupted.
VerifySummary verify(const std::filesystem::path& given, bool quiet, bool with_stages = false);

}  // namespace q3d::pipeline::dataset
