// Whole files or none: write under a temporary name, fsync, rename, fsync the folder.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace q3d::manifests {

// On failure the temporary is removed, an older file at `path` stays as it was, and std::runtime_error names
// the path and the system's reason (disk full, no permission, ...).
void write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> content);
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

// Makes a finished temporary file durable and gives it its name; removes it when that fails.
void commit_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

std::string read_file(const std::filesystem::path& path);  // throws std::runtime_error

// fsync of a folder: makes the names in it durable. Throws std::runtime_error.
void sync_folder(const std::filesystem::path& folder);

// Removes what a killed run left behind: files named *.tmp in `folder` (not recursive).
void remove_temporaries(const std::filesystem::path& folder);

}  // namespace q3d::manifests
