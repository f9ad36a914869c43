// Takes, compares, writes and reads the stamps (manifests/file_stamp.h) of many files and folders.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/file_stamp.h"

namespace q3d::pipeline::build {

struct StampedFile {
  std::string path;
  std::optional<manifests::FileStamp> stamp;  // empty if the file is absent; it must stay absent
};

// Takes the stamps of the paths in parallel. The result is in the order of the paths.
std::vector<StampedFile> stamp_files(std::vector<std::string> paths);
// Returns whether every file still has its stamp. Compares in parallel, and stops at the first difference.
bool have_stamps(std::span<const StampedFile> files);

// Returns the time of the newest change of any of the files, in ns since 1970; 0 if there are none.
std::int64_t newest_change_ns(std::span<const StampedFile> files);

// Returns the folder and every folder below it, without those reached through symbolic links and without
// `except`. A file that is added, removed or renamed changes the stamp of its folder. Returns nothing if
// there are more than `most` entries.
std::optional<std::vector<std::string>> folders_below(const std::filesystem::path& folder,
                                                      const std::filesystem::path& except, std::size_t most);

// Writes files as lines of text. Files of one folder that follow each other share a line for the folder.
class StampWriter {
 public:
  // Appends the files' lines. Returns false if a path holds a line feed and so fits no line.
  bool append(std::span<const StampedFile> files, std::string& text);

 private:
  std::string folder_;  // folder of the last file, with its '/'
};

// Reads the lines of a StampWriter, given in their order and without line feeds.
class StampReader {
 public:
  // Appends the line's file, if it is not a folder's line. Returns false if it is neither.
  bool read(std::string_view line, std::vector<StampedFile>& files);

 private:
  std::string folder_;
};

}  // namespace q3d::pipeline::build
