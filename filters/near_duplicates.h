// Finds pictures that look alike among many, by their hashes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "manifests/picture_hash.h"

namespace q3d::filters {

inline constexpr int kMaxHashDistance = 15;  // the largest distance that HashIndex can search

// Finds 64-bit hashes within a Hamming distance d, exactly, by multi-index hashing (Norouzi, Punjani, Fleet:
// "Fast Search in Hamming Space with Multi-Index Hashing", 2012). Of four bands of 16 bits, one must differ
// in at most d / 4 bits. Therefore each band is searched only for the values near its own. The index takes 48
// bytes for each hash plus 1 MB. Every band keeps the hashes in its own order, so that a search reads a few
// contiguous runs of memory instead of a thousand scattered places.
class HashIndex {
 public:
  // Throws std::invalid_argument unless 0 <= max_distance <= kMaxHashDistance and there are fewer than 2^32
  // hashes.
  HashIndex(std::span<const std::uint64_t> hashes, int max_distance);

  struct Match {
    std::uint32_t position = 0;  // index of the hash in the list that the constructor was given
    int distance = 0;
  };
  // Returns all hashes within max_distance, each once, in no particular order.
  void search(std::uint64_t hash, std::vector<Match>& matches) const;

  std::size_t size() const { return size_; }

 private:
  struct Band {
    std::vector<std::uint32_t> starts;     // 65,537: where each value's hashes begin in `positions`
    std::vector<std::uint32_t> positions;  // sorted by the band's value, then by position
    std::vector<std::uint64_t> hashes;     // of these positions
  };
  std::size_t size_ = 0;
  int max_distance_;
  std::array<Band, 4> bands_;
  std::vector<std::uint16_t> near_values_;  // all differences of a band with at most max_distance / 4 bits
};

struct Likeness {
  std::uint32_t position = 0;  // of the reference
  int distance = 0;            // bits of 64
  bool mirrored = false;       // true if the mirror image looks alike
};

// Returns the reference nearest to the query, upright or mirrored, within the index's distance. Of equally
// near ones it is the upright one, then the first. `references` is an index over the references' upright
// hashes. Several threads may use one index at once.
std::optional<Likeness> nearest_likeness(const HashIndex& references, const manifests::PictureHash& query);

// Returns groups of pictures that are linked by likeness within max_distance. Each group has two or more
// pictures; its positions ascend, and groups are ordered by their first position. Throws like HashIndex's
// constructor.
std::vector<std::vector<std::uint32_t>> groups_alike(std::span<const manifests::PictureHash> pictures,
                                                     int max_distance);

}  // namespace q3d::filters
