// Compares the files in the stages' folders with their journals, without changing anything.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace q3d::pipeline::stages {

struct StageProblem {
  std::filesystem::path file;
  std::string text;      // what was found and what was expected
  std::string expected;  // SHA-256 that a unit's file must have; empty for a journal, manifest or plan
};

struct StageCheck {
  std::int64_t files = 0;  // number of units' files that were read
  std::vector<StageProblem> problems;
};

// Reads every unit's file that a journal in <out>/stages names, the journals themselves, the manifests and
// the builds' plans. A file without a journal line is no problem, because a killed run left it and no build
// uses it. The result is empty if there are no stages. Throws manifests::IoError and Interrupted.
StageCheck check_stages(const std::filesystem::path& out);

}  // namespace q3d::pipeline::stages
