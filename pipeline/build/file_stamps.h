// Stamps of files: what the file system says of a file without reading it. The kernel sets a file's ctime at
// every change of its bytes or its other stamps, and no program can set it, so a file whose stamp is the same
// has not been written since. What rots below the file system leaves the stamp alone.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace q3d::pipeline::build {

struct FileStamp {
  std::uint64_t size = 0;
  std::int64_t mtime_ns = 0;
  std::int64_t ctime_ns = 0;
  std::uint64_t inode = 0;
  std::uint64_t device = 0;
  bool operator==(const FileStamp&) const = default;
};

// Of the file or folder, or of what a symbolic link leads to; nothing if there is none.
std::optional<FileStamp> stamp_of(const std::filesystem::path& path);

struct StampedFile {
  std::string path;
  std::optional<FileStamp> stamp;  // nothing: there is no such file, and there must be none
};

// In parallel.
std::vector<StampedFile> stamp_files(std::vector<std::string> paths);
// Whether each file still has its stamp. In parallel; stops at the first that has not.
bool have_stamps(const std::vector<StampedFile>& files);

// The newest change of any of the files, in ns since 1970; 0 if there are none.
std::int64_t newest_change_ns(const std::vector<StampedFile>& files);

// The folder and every folder below it, without those reached through symbolic links and without `except`. A
// file that is added, removed or renamed changes the stamp of its folder. Nothing if there are more than
// `most` entries.
std::optional<std::vector<std::string>> folders_below(const std::filesystem::path& folder,
                                                      const std::filesystem::path& except, std::size_t most);

// The files as text, sorted, one line each; nothing if a path holds a line feed.
std::optional<std::string> to_text(std::vector<StampedFile> files);
// Throws std::invalid_argument for another text.
std::vector<StampedFile> stamps_from_text(std::string_view text);

}  // namespace q3d::pipeline::build
