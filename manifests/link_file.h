// A second name for a finished file.
#pragma once

#include <filesystem>

namespace q3d::manifests {

// Makes `to` a hard link to `from`, so that versions that share a file share its bytes; a copy where the file
// system has no hard links or differs. A file that is there under another name than `from` (a damaged one,
// say) is replaced in one step. The result can be read by all and written by none. Throws
// std::filesystem::filesystem_error and IoError.
void link_or_copy(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace q3d::manifests
