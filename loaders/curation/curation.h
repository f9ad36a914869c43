// Chooses a balanced subset of a large set of pictures by a rule, and says for every other picture why it is
// left out.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::loaders::curation {

// One picture of the whole set, with any number of animals in it.
struct CuratedPicture {
  std::string split;      // train, test
  std::string image_ref;  // as the annotation file names it
  std::string source;     // sub-dataset
  std::string species;    // from its name or its source; empty if neither tells it
  std::string clip;    // the video of which it is a frame (loaders/curation/clip.h); empty if it is no frame
  bool usable = true;  // at least one of its records can be used
};

struct CurationRule {
  // Lists, for each species of the subset, the names that count as it. A picture belongs to the species that
  // lists its species name. If none does, the first words of the name are dropped one by one: "polar bear"
  // counts as the species that lists "bear".
  std::map<std::string, std::vector<std::string>> species;
  std::map<std::string, std::int64_t> pictures;  // split -> how many to take, if there are enough
  std::optional<std::int64_t> cap;               // the largest number of pictures of one species in one split
  std::uint64_t seed = 0;
};

// The decision about a picture. The names must not change, because they are written into the list.
enum class Choice : std::uint8_t {
  chosen,
  unusable,             // none of its records can be used
  species_unknown,      // neither the name nor the source tells the species
  species_not_listed,   // the species is none of the rule's
  clip_in_other_split,  // its video stays in another split, which has more of its frames
  not_drawn,            // its species already has its share
};
std::string_view to_string(Choice choice);

struct Curated {
  std::string species;  // species of the subset; if it is not listed, the species of the picture
  Choice choice = Choice::not_drawn;
};

// Chooses pictures by the rule. Splits are kept: no picture moves to another split. If the frames of a video
// lie in several splits, the video is kept in the split that has most of its usable frames of listed species
// (of equal splits, the first in the alphabet), and left out of the others. Then each split is drawn by
// itself. fair_shares() shares out its pictures. Within a species, every video gives one frame before any
// video gives a second. The order comes from the SHA-256 of seed and name, so pictures that are added later
// do not change it.
//
// Returns one result for each picture, in the order given. Throws std::invalid_argument if a name is listed
// for two species.
std::vector<Curated> curate(std::span<const CuratedPicture> pictures, const CurationRule& rule);

// Returns shares that are as equal as the available numbers allow: min(available, cap, level), with the one
// level at which they add up to `total`. If no whole level does, the first species that have more get one
// more. If there is less than `total`, everything that the cap allows is taken.
std::vector<std::int64_t> fair_shares(std::span<const std::int64_t> available, std::int64_t total,
                                      std::optional<std::int64_t> cap);

}  // namespace q3d::loaders::curation
