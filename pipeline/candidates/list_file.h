// Reads text files in which a person lists samples, one on each line: vetoes and corrected keypoints.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::candidates {

struct ListLine {
  int number = 0;  // in the file, from 1
  std::string text;
};

struct ListFile {
  std::string sha256;
  std::vector<ListLine> lines;  // without empty lines, lines that begin with '#', and a '\r' at the end
};

// Reads the lines of a file. Throws ConfigError that begins with `what` if the path names no file, and
// manifests::IoError if the file exists and cannot be read.
ListFile read_list_file(const std::filesystem::path& file, std::string_view what);

}  // namespace q3d::pipeline::candidates
