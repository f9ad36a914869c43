#include "filters/near_duplicates.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace q3d::filters {
namespace {

constexpr unsigned kBandBits = 16;
constexpr std::size_t kBandValues = std::size_t{1} << kBandBits;

std::uint16_t band_value(std::uint64_t hash, std::size_t band) {
  return static_cast<std::uint16_t>(hash >> (kBandBits * band));
}

// Keeps which group each picture belongs to. A group is named by its smallest member.
class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }

  std::uint32_t find(std::uint32_t member) {
    while (parent_[member] != member) member = parent_[member] = parent_[parent_[member]];
    return member;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

HashIndex::HashIndex(std::span<const std::uint64_t> hashes, int max_distance)
    : size_(hashes.size()), max_distance_(max_distance) {
  if (max_distance < 0 || max_distance > kMaxHashDistance) {
    throw std::invalid_argument("hash distance: got " + std::to_string(max_distance) + ", expected 0 to " +
                                std::to_string(kMaxHashDistance));
  }
  if (hashes.size() >= std::numeric_limits<std::uint32_t>::max()) {
    throw std::invalid_argument("hashes: got " + std::to_string(hashes.size()) + ", expected less than 2^32");
  }
  for (std::size_t value = 0; value < kBandValues; ++value) {
    if (std::popcount(value) <= max_distance / 4) near_values_.push_back(static_cast<std::uint16_t>(value));
  }
  for (std::size_t b = 0; b < bands_.size(); ++b) {
    Band& band = bands_[b];
    band.starts.assign(kBandValues + 1, 0);
    for (const std::uint64_t hash : hashes) ++band.starts[band_value(hash, b) + 1U];
    std::partial_sum(band.starts.begin(), band.starts.end(), band.starts.begin());
    std::vector<std::uint32_t> next(band.starts.begin(), band.starts.end() - 1);
    band.positions.resize(hashes.size());
    band.hashes.resize(hashes.size());
    for (std::uint32_t i = 0; i < hashes.size(); ++i) {
      const std::uint32_t place = next[band_value(hashes[i], b)]++;
      band.positions[place] = i;
      band.hashes[place] = hashes[i];
    }
  }
}

void HashIndex::search(std::uint64_t hash, std::vector<Match>& matches) const {
  matches.clear();
  const int near = max_distance_ / 4;
  for (std::size_t b = 0; b < bands_.size(); ++b) {
    const Band& band = bands_[b];
    const std::uint16_t value = band_value(hash, b);
    for (const std::uint16_t difference : near_values_) {
      const auto wanted = static_cast<std::uint16_t>(value ^ difference);
      for (std::uint32_t i = band.starts[wanted]; i < band.starts[wanted + 1U]; ++i) {
        const std::uint64_t differing = hash ^ band.hashes[i];
        const int distance = std::popcount(differing);
        if (distance > max_distance_) continue;
        // A match is reported only from the first band that is near.
        bool reported = false;
        for (std::size_t earlier = 0; earlier < b && !reported; ++earlier) {
          reported = std::popcount(band_value(differing, earlier)) <= near;
        }
        if (!reported) matches.push_back({band.positions[i], distance});
      }
    }
  }
}

std::optional<Likeness> nearest_likeness(const HashIndex& references, const manifests::PictureHash& query) {
  const auto rank = [](const Likeness& like) {
    return std::tuple(like.distance, like.mirrored, like.position);
  };
  std::optional<Likeness> nearest;
  std::vector<HashIndex::Match> matches;
  for (const bool mirrored : {false, true}) {
    references.search(mirrored ? query.mirrored : query.upright, matches);
    for (const HashIndex::Match& match : matches) {
      const Likeness found{match.position, match.distance, mirrored};
      if (!nearest || rank(found) < rank(*nearest)) nearest = found;
    }
  }
  return nearest;
}

std::vector<std::vector<std::uint32_t>> groups_alike(std::span<const manifests::PictureHash> pictures,
                                                     int max_distance) {
  // Pictures with equal hashes share one entry. Otherwise all frames of a still camera would be compared with
  // each other.
  std::unordered_map<std::uint64_t, std::uint32_t> first_of;
  std::vector<std::uint64_t> distinct;
  std::vector<std::uint64_t> mirrored;
  std::vector<std::uint32_t> entry_of;
  for (const manifests::PictureHash& picture : pictures) {
    const auto entry = static_cast<std::uint32_t>(distinct.size());
    const auto [found, is_new] = first_of.emplace(picture.upright, entry);
    entry_of.push_back(found->second);
    if (!is_new) continue;
    distinct.push_back(picture.upright);
    mirrored.push_back(picture.mirrored);
  }
  const HashIndex index(distinct, max_distance);
  Groups groups(distinct.size());
  std::vector<HashIndex::Match> matches;
  for (std::uint32_t i = 0; i < distinct.size(); ++i) {
    for (const std::uint64_t hash : {distinct[i], mirrored[i]}) {
      index.search(hash, matches);
      for (const HashIndex::Match& match : matches) groups.join(i, match.position);
    }
  }
  std::vector<std::vector<std::uint32_t>> members(distinct.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    members[groups.find(entry_of[i])].push_back(static_cast<std::uint32_t>(i));
  }
  std::erase_if(members, [](const auto& group) { return group.size() < 2; });
  std::sort(members.begin(), members.end());
  return members;
}

}  // namespace q3d::filters
