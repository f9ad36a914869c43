// Gives a finished file a second name.
#pragma once

#include <filesystem>

namespace q3d::manifests {

// Makes `to` a hard link to `from`, so that versions that share a file share its bytes. Makes a copy instead
// if the file system has no hard links, or if the two paths lie on different file systems. If `to` exists and
// is not a link to `from` (for example a damaged file), it is replaced in one step. The result can be read by
// all and written by none. Throws std::filesystem::filesystem_error and IoError.
void link_or_copy(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace q3d::manifests
