// The stamps (manifests/file_stamp.h) of many files and folders, and their text form.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/file_stamp.h"

namespace q3d::pipeline::build {

struct StampedFile {
  std::string path;
  std::optional<manifests::FileStamp> stamp;  // nothing: there is no such file, and there must be none
};

// Takes the stamps in parallel.
std::vector<StampedFile> stamp_files(std::vector<std::string> paths);
// Says whether each file still has its stamp. Compares in parallel, and stops at the first that has not.
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
