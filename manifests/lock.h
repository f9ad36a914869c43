// Keeps a second builder off an output folder.
#pragma once

#include <filesystem>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {

// Holds an advisory lock (flock) on `<folder>/.lock` until destroyed; the kernel drops it when the process
// dies. The file says who holds it and is left in place: removing it would let two builders lock two files of
// that name. Throws std::runtime_error that names the holder's process, host and start when the folder is in
// use, and when the folder is absent or not writable.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);

 private:
  FileDescriptor file_;
};

}  // namespace q3d::manifests
