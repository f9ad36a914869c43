// A balanced subset of a large set of pictures, by a rule: which to take, and why each other is left.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::loaders::curation {

// One picture of the whole set, whatever the number of animals in it.
struct CuratedPicture {
  std::string split;      // train, test
  std::string image_ref;  // as the annotation file names it
  std::string source;     // sub-dataset
  std::string species;    // as its name or its source tells; empty when nothing does
  std::string clip;       // the video that it is a frame of (loaders/curation/clip.h); empty when of none
  bool usable = true;     // it has a record that can be used
};

struct CurationRule {
  // A species of the subset -> the names that count as it. A picture's species is the one that lists its
  // name, or else the name without its first words: "polar bear" counts as one that lists "bear".
  std::map<std::string, std::vector<std::string>> species;
  std::map<std::string, std::int64_t> pictures;  // split -> how many to take, if there are as many
  std::optional<std::int64_t> cap;               // most pictures of one species in one split
  std::uint64_t seed = 0;
};

// What became of a picture. The names are stable: they are written into the list.
enum class Choice : std::uint8_t {
  chosen,
  unusable,             // none of its records can be used
  species_unknown,      // neither name nor source tells it
  species_not_listed,   // by the rule's species
  clip_in_other_split,  // its video has more frames in another split
  not_drawn,            // its species has its share without it
};
std::string_view to_string(Choice choice);

struct Curated {
  std::string species;  // of the subset; as told where it is not listed
  Choice choice = Choice::not_drawn;
};

// Splits are kept: no picture changes its side. A video whose frames lie in several splits is kept whole
// where most of its usable frames of listed species are (of equals the split first in the alphabet), and left
// out of the others. Then each split is drawn by itself: its pictures are shared out by fair_shares(), and
// within a species every video gives one frame before any gives a second, in an order by SHA-256 of seed and
// name, which pictures that are added later do not disturb.
//
// One result a picture, in the order given. Throws std::invalid_argument when a name is listed for two
// species.
std::vector<Curated> curate(std::span<const CuratedPicture> pictures, const CurationRule& rule);

// Shares that are as equal as what is there allows: min(available, cap, level) with the one level at which
// they add up to `total`; where no whole level does, the first species with more get one more. All that the
// cap lets through when there is less than `total`.
std::vector<std::int64_t> fair_shares(std::span<const std::int64_t> available, std::int64_t total,
                                      std::optional<std::int64_t> cap);

}  // namespace q3d::loaders::curation
