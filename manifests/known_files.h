// Earlier runs remember the digests of files. This header finds a file by its digest.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace q3d::manifests {

// Reads the file of a DigestCache. Returns absolute paths by the SHA-256 that their files had. A file may
// have changed or gone since, so compare its bytes before you use it. Damaged lines are dropped. The map is
// empty if there is no such file. Throws IoError if there is one that cannot be read.
std::multimap<std::string, std::filesystem::path> read_known_files(const std::filesystem::path& digests);

}  // namespace q3d::manifests
