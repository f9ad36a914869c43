// Writes files completely or not at all: under a temporary name, then fsync, rename, and fsync of the folder.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace q3d::manifests {

// Writes `content` to `path`. If this fails, the temporary file is removed, an older file at `path` stays as
// it was, and IoError (manifests/file_descriptor.h) names the path and the reason (disk full, ...).
void write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> content);
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

// Makes a finished temporary file durable and renames it to `path`. If this fails, the temporary file is
// removed.
void commit_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

// The whole content of a regular file. Throws IoError.
std::string read_file(const std::filesystem::path& path);

// Calls fsync on a folder, which makes the names in it durable. Throws std::runtime_error.
void sync_folder(const std::filesystem::path& folder);

// Removes the files that a killed run left behind: those named *.tmp in `folder` (not recursive).
void remove_temporaries(const std::filesystem::path& folder);

}  // namespace q3d::manifests
