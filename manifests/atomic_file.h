// Whole files or none: write under a temporary name, fsync, rename, fsync the folder.
#pragma once

#include <filesystem>
#include <string_view>

namespace q3d::manifests {

// Throws std::runtime_error naming the path and the system's reason (disk full, no permission, ...).
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

// Makes a finished temporary file durable and gives it its name.
void commit_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

std::string read_file(const std::filesystem::path& path);  // throws std::runtime_error

// Removes what a killed run left behind: files named *.tmp in `folder` (not recursive).
void remove_temporaries(const std::filesystem::path& folder);

}  // namespace q3d::manifests
