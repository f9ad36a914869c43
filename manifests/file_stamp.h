// Stamps of files: what the file system says of a file without reading it. The kernel sets a file's ctime at
// every change of its bytes or its other stamps, and no program can set it, so a file whose stamp is the same
// has not been written since. What rots below the file system leaves the stamp alone.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {

inline constexpr std::int64_t kNsPerSecond = 1'000'000'000;

struct FileStamp {
  std::uint64_t size = 0;
  std::int64_t mtime_ns = 0;
  std::int64_t ctime_ns = 0;
  std::uint64_t inode = 0;
  std::uint64_t device = 0;
  auto operator<=>(const FileStamp&) const = default;
};

// The stamp of the file or folder, or of what a symbolic link leads to; nothing, and errno, if the kernel
// gives none.
std::optional<FileStamp> stamp_of(const std::filesystem::path& path);
// The stamp of an open file. Throws IoError.
FileStamp stamp_of(const FileDescriptor& file);

}  // namespace q3d::manifests
