// A file that is read over a long time and must stay the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>

#include "manifests/file_descriptor.h"
#include "manifests/file_stamp.h"

namespace q3d::manifests {

// If the server of a network disk has forgotten the open file (ESTALE), the file is opened again, and its
// stamp must be the same.
class ReopenedFile {
 public:
  // Opens a regular file. Throws IoError.
  explicit ReopenedFile(std::filesystem::path path);

  std::uint64_t size() const { return stamp_.size; }
  // Fills `bytes` from `offset` on. Safe from many threads at once. Throws IoError, also if the file was
  // written or replaced before it had to be opened again.
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  std::shared_ptr<const FileDescriptor> file() const;
  void open_again(const std::shared_ptr<const FileDescriptor>& forgotten) const;

  std::filesystem::path path_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const FileDescriptor> file_;  // guarded by mutex_
  FileStamp stamp_;
};

}  // namespace q3d::manifests
