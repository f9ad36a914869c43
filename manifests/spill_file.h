// Holds data on disk that a run needs again and does not keep in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {

// A file without a name. The system deletes it when it is closed, or when the process ends in any way. Many
// threads may read what was appended; only one thread may append.
class SpillFile {
 public:
  // The file lies in `folder`, which must exist. Throws IoError.
  explicit SpillFile(const std::filesystem::path& folder);

  // Returns where the bytes begin. Throws IoError (disk full, ...).
  std::uint64_t append(std::span<const std::byte> bytes);
  // Throws IoError.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const { file_.read_at(offset, bytes); }
  std::uint64_t size() const { return size_; }

 private:
  FileDescriptor file_;
  std::uint64_t size_ = 0;
};

}  // namespace q3d::manifests
