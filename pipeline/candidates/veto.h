// Reads the user's list of samples that are left out of a dataset.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>

namespace q3d::pipeline::candidates {

struct Veto {
  std::map<std::string, std::string> reasons;  // sample id -> reason, for people
  std::string sha256;                          // of the file
  std::size_t matched = 0;                     // ids that belong to a candidate
};

// Reads a file with one sample id on each line, as verdicts.csv has them, and the reason after a tab. Empty
// lines and lines that begin with '#' are skipped. Throws ConfigError that names file and line for a file
// that cannot be read and for a malformed id.
Veto read_veto(const std::filesystem::path& file);

}  // namespace q3d::pipeline::candidates
