// A folder that replaces an output folder in a run that must write nothing into it.
#pragma once

#include <filesystem>

namespace q3d::pipeline::build {

// It is made in the system's folder of temporary files, with copies of the output folder's caches
// (digests.txt, picture_hashes.txt), and the destructor removes it.
class ScratchCopy {
 public:
  // `out` need not exist. Throws std::filesystem::filesystem_error or std::runtime_error when the folder
  // cannot be made.
  explicit ScratchCopy(const std::filesystem::path& out);
  ~ScratchCopy();
  ScratchCopy(const ScratchCopy&) = delete;
  ScratchCopy& operator=(const ScratchCopy&) = delete;

  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

}  // namespace q3d::pipeline::build
