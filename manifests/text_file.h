// Reads text files that people bring: annotation files, topologies, tables.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace q3d::manifests {

inline constexpr std::uint64_t kMaxTextBytes = std::uint64_t{4} << 30U;

// Says what a file is that cannot be a text file of labels, and what to do about it: an empty file, a Git LFS
// pointer, an HTML page, an archive, a pickle, and so on. Returns "" for any other content.
std::string named_content(std::string_view content);

// Reads a whole text file as UTF-8. A byte order mark is dropped, and UTF-16 with such a mark is converted.
// Throws std::runtime_error that names the file, what was found and `expected` ("an annotation file") if the
// file is absent, larger than `max_bytes`, of another encoding, or one of those that named_content knows.
// Throws IoError if the file exists and cannot be read.
std::string read_text_file(const std::filesystem::path& file, std::string_view expected,
                           std::uint64_t max_bytes = kMaxTextBytes);

}  // namespace q3d::manifests
