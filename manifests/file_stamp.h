// A stamp of a file is what the file system says about the file without reading it. The kernel sets a file's
// ctime at every change of its bytes or its other stamps, and no program can set it, so a file whose stamp is
// the same has not been written since. Damage below the file system, such as a decaying disk, does not change
// the stamp.
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

// Returns the stamp of the file or folder, or of the target of a symbolic link. Returns nothing, with errno
// set, if the kernel gives none.
std::optional<FileStamp> stamp_of(const std::filesystem::path& path);
// Returns the stamp of an open file. Throws IoError.
FileStamp stamp_of(const FileDescriptor& file);

}  // namespace q3d::manifests
