// The list that `curate` writes and `build` reads: every picture of the whole set, and what became of it.
#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>

#include "loaders/curation/curation.h"

namespace q3d::pipeline::candidates {

// CSV text: split, picture, verdict, species, source, clip; in the order given. The verdict is `chosen` or
// why not; the species is the subset's name for it, or as told where it is not listed.
std::string curation_csv(std::span<const loaders::curation::CuratedPicture> pictures,
                         std::span<const loaders::curation::Curated> choices);

// The chosen pictures of one split: the annotation file's name of a picture -> its species. Throws
// ConfigError naming file and line for a file that cannot be read or is no such list.
std::map<std::string, std::string> chosen_pictures(const std::filesystem::path& list,
                                                   const std::string& split);

}  // namespace q3d::pipeline::candidates
