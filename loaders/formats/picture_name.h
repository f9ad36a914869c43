// Interprets the names of pictures as labelling tools write them: paths of this or another system, and URLs.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::loaders::formats {

// One way to understand a picture's name.
struct NameReading {
  std::filesystem::path
      path;                  // normalised, '/' between folders, without drive, share, scheme, host and query
  bool is_absolute = false;  // it starts at another disk's or server's root, so only its tails can exist here
  bool is_posix_absolute =
      false;  // it begins with '/' as it was written, so it may also name a file of this system
};

// Returns the ways to understand a name, the most literal one first:
// - as a POSIX path, as it stands;
// - with backslashes between folders, without a drive letter (D:\), a UNC share (\\server\share), or the
//   scheme, host, query and fragment of a URL;
// - a path in the query of a URL (Label Studio's ?d=dogs/a.jpg);
// - each of these with %20 and the like decoded.
// Readings that equal an earlier one are left out.
std::vector<NameReading> readings_of(std::string_view name);

// Returns whether a normalised relative path leaves its folder.
bool climbs_out(const std::filesystem::path& normal);

// Returns the name as it appears in a sample id: relative to the root, without "." and "..", on one line. If
// the file gives an absolute name, a URL or one that climbs out, it is the base name.
std::string id_part(std::string_view name);

}  // namespace q3d::loaders::formats
