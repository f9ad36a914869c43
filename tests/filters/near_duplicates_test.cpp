// The index of hashes against comparing each with each.
#include "filters/near_duplicates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <random>

namespace q3d::filters {
namespace {

using manifests::PictureHash;
using ::testing::ElementsAre;

std::uint64_t with_flipped(std::uint64_t hash, int bits, std::mt19937_64& engine) {
  std::vector<int> places(64);
  for (int i = 0; i < 64; ++i) places[static_cast<std::size_t>(i)] = i;
  std::shuffle(places.begin(), places.end(), engine);
  for (int i = 0; i < bits; ++i) hash ^= std::uint64_t{1} << places[static_cast<std::size_t>(i)];
  return hash;
}

TEST(HashIndex, finds_all_within_the_distance_and_each_once) {
  std::mt19937_64 engine(7);
  for (const int max_distance : {0, 3, 4, 6, 7, 11, 15}) {
    std::vector<std::uint64_t> hashes;
    for (int i = 0; i < 300; ++i) hashes.push_back(engine());
    const std::uint64_t query = engine();
    for (int distance = 0; distance <= 20; ++distance) {
      for (int i = 0; i < 20; ++i) hashes.push_back(with_flipped(query, distance, engine));
    }
    std::vector<std::pair<std::uint32_t, int>> expected;
    for (std::uint32_t i = 0; i < hashes.size(); ++i) {
      const int distance = std::popcount(query ^ hashes[i]);
      if (distance <= max_distance) expected.emplace_back(i, distance);
    }
    ASSERT_GE(expected.size(), 20U);
    const HashIndex index(hashes, max_distance);
    std::vector<HashIndex::Match> matches;
    index.search(query, matches);
    std::vector<std::pair<std::uint32_t, int>> found;
    for (const HashIndex::Match& match : matches) found.emplace_back(match.position, match.distance);
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected) << max_distance;
  }
}

TEST(HashIndex, an_empty_one_finds_nothing_and_far_distances_are_refused) {
  std::vector<HashIndex::Match> matches(3);
  HashIndex({}, 6).search(5, matches);
  EXPECT_TRUE(matches.empty());
  EXPECT_THROW(HashIndex({1}, 16), std::invalid_argument);
  EXPECT_THROW(HashIndex({1}, -1), std::invalid_argument);
}

TEST(NearestLikeness, takes_the_nearest_then_the_upright_then_the_first) {
  const HashIndex references({0xF0F0, 0xF0F1, 0xF0F1, 0x0F0F0000}, 4);
  const std::uint64_t far = 0xFFFFFFFFFFFFFFFF;
  const auto equal = nearest_likeness(references, {0xF0F1, far});  // to 1 and 2; one bit from 0
  ASSERT_TRUE(equal);
  EXPECT_EQ(equal->position, 1U);
  EXPECT_EQ(equal->distance, 0);
  EXPECT_FALSE(equal->mirrored);
  const auto turned = nearest_likeness(references, {far, 0x0F0F0001});  // mirrored, one bit from 3
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->position, 3U);
  EXPECT_EQ(turned->distance, 1);
  EXPECT_TRUE(turned->mirrored);
  const auto both = nearest_likeness(references, {0xF0F3, 0xF0F3});
  ASSERT_TRUE(both);
  EXPECT_FALSE(both->mirrored);
  EXPECT_FALSE(nearest_likeness(references, {0xFFFFFFFF00000000, 0xFFFFFFFF00000000}));
}

TEST(GroupsAlike, links_chains_mirror_images_and_equals) {
  const std::uint64_t far = 0xAAAAAAAAAAAAAAAA;
  const std::vector<PictureHash> pictures{{0b000000, far},  // 0: two bits from 1
                                          {0b000011, far},  // 1: two bits from 2, so a chain of three
                                          {0b001111, far},  // 2
                                          {0xFFFF000000000000, 0x1234567812345},  // 3: its mirror image is 5
                                          {0x00FF00FF00FF00FF, far},              // 4: alone
                                          {0x1234567812345, 0xFFFF000000000000},  // 5
                                          {0b000000, far}};                       // 6: equal to 0
  EXPECT_THAT(groups_alike(pictures, 2), ElementsAre(ElementsAre(0U, 1U, 2U, 6U), ElementsAre(3U, 5U)));
  EXPECT_THAT(groups_alike(pictures, 1), ElementsAre(ElementsAre(0U, 6U), ElementsAre(3U, 5U)));
  EXPECT_TRUE(groups_alike({}, 6).empty());
}

// Every link that comparing each with each finds, and no other.
TEST(GroupsAlike, equals_comparing_each_with_each) {
  std::mt19937_64 engine(11);
  std::vector<PictureHash> pictures;
  for (int i = 0; i < 120; ++i) {
    const PictureHash first{engine(), engine()};
    pictures.push_back(first);
    pictures.push_back({with_flipped(first.upright, i % 12, engine), engine()});
    pictures.push_back(
        {with_flipped(first.mirrored, i % 9, engine), with_flipped(first.upright, i % 9, engine)});
  }
  constexpr int kDistance = 6;
  std::vector<std::size_t> group(pictures.size());
  for (std::size_t i = 0; i < group.size(); ++i) group[i] = i;
  for (std::size_t i = 0; i < group.size(); ++i) {
    for (std::size_t j = 0; j < group.size(); ++j) {
      const bool alike = std::popcount(pictures[i].upright ^ pictures[j].upright) <= kDistance ||
                         std::popcount(pictures[i].mirrored ^ pictures[j].upright) <= kDistance;
      if (!alike || group[i] == group[j]) continue;
      const std::size_t from = std::max(group[i], group[j]);
      const std::size_t to = std::min(group[i], group[j]);
      std::replace(group.begin(), group.end(), from, to);
    }
  }
  std::vector<std::vector<std::uint32_t>> expected(pictures.size());
  for (std::size_t i = 0; i < group.size(); ++i) expected[group[i]].push_back(static_cast<std::uint32_t>(i));
  std::erase_if(expected, [](const auto& members) { return members.size() < 2; });
  ASSERT_GT(expected.size(), 50U);
  EXPECT_EQ(groups_alike(pictures, kDistance), expected);
}

}  // namespace
}  // namespace q3d::filters
