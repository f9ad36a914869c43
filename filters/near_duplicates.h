// Finding pictures that look alike among many, by their hashes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "manifests/picture_hash.h"

namespace q3d::filters {

inline constexpr int kMaxHashDistance = 15;  // what HashIndex searches in one go

// Finds 64-bit hashes within a Hamming distance d. Multi-index hashing (Norouzi, Punjani, Fleet: "Fast Search
// in Hamming Space with Multi-Index Hashing", 2012): of four bands of 16 bits one must differ in at most d /
// 4, so each is searched for its own near values alone. Exact. Takes 24 bytes a hash and 1 MB.
class HashIndex {
 public:
  // Throws std::invalid_argument unless 0 <= max_distance <= kMaxHashDistance, or for 2^32 hashes and more.
  HashIndex(std::vector<std::uint64_t> hashes, int max_distance);

  struct Match {
    std::uint32_t position = 0;  // of the hash, as given to the constructor
    int distance = 0;
  };
  // All that lie within max_distance, each once, in no particular order.
  void search(std::uint64_t hash, std::vector<Match>& matches) const;

  std::size_t size() const { return hashes_.size(); }

 private:
  struct Band {
    std::vector<std::uint32_t> starts;     // 65,537: where each value's hashes begin in `positions`
    std::vector<std::uint32_t> positions;  // sorted by the band's value, then by position
  };
  std::vector<std::uint64_t> hashes_;
  int max_distance_;
  std::array<Band, 4> bands_;
  std::vector<std::uint16_t> near_values_;  // differences of a band: all of at most max_distance / 4 bits
};

struct Likeness {
  std::uint32_t position = 0;  // of the reference
  int distance = 0;            // bits of 64
  bool mirrored = false;       // it is the mirror image that looks alike
};

// Of an index over the references' upright hashes the nearest to the query, upright or mirrored, within the
// index's distance; of equals the upright, then the first. Threads may ask one index at once.
std::optional<Likeness> nearest_likeness(const HashIndex& references, const manifests::PictureHash& query);

// Groups of pictures that are linked by likeness within max_distance, two or more each: positions ascending,
// groups by their first. Throws as HashIndex's constructor does.
std::vector<std::vector<std::uint32_t>> groups_alike(std::span<const manifests::PictureHash> pictures,
                                                     int max_distance);

}  // namespace q3d::filters
