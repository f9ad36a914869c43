// A running evaluation keeps its finished units on disk, so that it can go on after it was stopped, and ranks
// can share it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "manifests/digest.h"
#include "manifests/lock.h"
#include "pipeline/evaluation/evaluate.h"

namespace q3d::pipeline::evaluation {

// The folder <out>/.parts: a lock, the digests of the pictures, and the results of the finished units. It is
// gone when the evaluation is complete.
class EvaluationParts {
 public:
  // Returns the folder of the parts of an evaluation into `out`.
  static std::filesystem::path folder_in(const std::filesystem::path& out) { return out / ".parts"; }

  // Opens the folder. Rank 0, which leads, makes and locks it, and removes the temporary files of a killed
  // run; the other ranks only read the digests. Throws std::runtime_error if another evaluation works there,
  // and manifests::IoError.
  EvaluationParts(const std::filesystem::path& out, bool leads);

  const std::filesystem::path& folder() const { return folder_; }
  manifests::DigestCache& digests() { return digests_; }
  // Removes the folder. Call it when everything is written.
  void remove();

 private:
  std::filesystem::path folder_;
  std::optional<manifests::FolderLock> lock_;
  manifests::DigestCache digests_;
};

// Returns the key of the results: a digest of everything besides the samples that decides a bit of them.
std::string key_of_results(const EvaluationConfig& config, const Plan& plan, const Evaluation& evaluation);

}  // namespace q3d::pipeline::evaluation
