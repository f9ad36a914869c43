// The user's list of samples to leave out of a dataset.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>

namespace q3d::pipeline::candidates {

struct Veto {
  std::map<std::string, std::string> reasons;  // sample id -> why, for people
  std::string sha256;                          // of the file
  std::size_t matched = 0;                     // ids that are a candidate's
};

// One sample id a line, as verdicts.csv has them; after a tab, why. Empty lines and lines that begin with '#'
// are passed over. Throws ConfigError naming file and line: for a file that cannot be read, and an id that is
// none.
Veto read_veto(const std::filesystem::path& file);

}  // namespace q3d::pipeline::candidates
