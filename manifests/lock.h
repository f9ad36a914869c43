// A lock that stops a second build from using the same output folder.
#pragma once

#include <filesystem>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {

// Holds an advisory lock (flock) on `<folder>/.lock` until it is destroyed; the kernel releases the lock when
// the process dies. The file says who holds the lock. It is never removed, because then two builds could lock
// two different files of that name; a symbolic link of that name is refused. Throws std::runtime_error if the
// folder is in use, with the process, host and start of the holder, and IoError if the folder is absent or
// not writable, or its file system has no locks. If durability().locks is false, nothing is locked.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);

 private:
  FileDescriptor file_;
};

}  // namespace q3d::manifests
