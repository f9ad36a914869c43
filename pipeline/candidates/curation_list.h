// The list that `curate` writes and `build` reads. It has every picture of the whole set with the decision
// about it.
#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>

#include "loaders/curation/curation.h"

namespace q3d::pipeline::candidates {

// Returns CSV text with the columns split, picture, verdict, species, source and clip, in the order of the
// pictures. The verdict is `chosen` or the reason against it. The species is the subset's name for it, or the
// picture's own if it is not listed.
std::string curation_csv(std::span<const loaders::curation::CuratedPicture> pictures,
                         std::span<const loaders::curation::Curated> choices);

// Returns the chosen pictures of one split: the picture's name in the annotation file -> its species. Throws
// ConfigError that names file and line for a file that cannot be read or is no such list.
std::map<std::string, std::string> chosen_pictures(const std::filesystem::path& list,
                                                   const std::string& split);

}  // namespace q3d::pipeline::candidates
