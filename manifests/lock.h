// Keeps a second builder off an output folder.
#pragma once

#include <filesystem>

namespace q3d::manifests {

// Holds an advisory lock (flock) on `<folder>/.lock` until destroyed; the kernel drops it when the process
// dies. Throws std::runtime_error that names the holder's host and process when the folder is in use.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace q3d::manifests
