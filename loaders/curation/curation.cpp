#include "loaders/curation/curation.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "loaders/species/species.h"
#include "manifests/digest.h"

namespace q3d::loaders::curation {
namespace {

constexpr std::array<std::string_view, 6> kChoiceNames{
    "chosen", "unusable", "species_unknown", "species_not_listed", "clip_in_other_split", "not_drawn"};
static_assert(kChoiceNames.size() == static_cast<std::size_t>(Choice::not_drawn) + 1);

using SpeciesOfName = std::map<std::string, std::string, std::less<>>;

SpeciesOfName names_of(const CurationRule& rule) {
  SpeciesOfName species_of;
  for (const auto& [species, names] : rule.species) {
    for (const std::string& name : names) {
      const auto [known, is_new] = species_of.emplace(species::normalised_species(name), species);
      if (!is_new && known->second != species) {
        throw std::invalid_argument(fmt::format("species: the name \"{}\" is listed for {} and for {}", name,
                                                known->second, species));
      }
    }
  }
  return species_of;
}

// Returns the listed species for a name; empty if there is none.
std::string listed_species(const SpeciesOfName& species_of, std::string_view name) {
  while (!name.empty()) {
    const auto found = species_of.find(name);
    if (found != species_of.end()) return found->second;
    const auto space = name.find(' ');
    name = space == std::string_view::npos ? std::string_view() : name.substr(space + 1);
  }
  return {};
}

// Decides by species only. The pictures that may be drawn stay `not_drawn`.
std::vector<Curated> by_species(std::span<const CuratedPicture> pictures, const CurationRule& rule) {
  const SpeciesOfName species_of = names_of(rule);
  std::vector<Curated> choices;
  for (const CuratedPicture& picture : pictures) {
    Curated& made = choices.emplace_back();
    made.species = species::normalised_species(picture.species);
    std::string listed = listed_species(species_of, made.species);
    if (!picture.usable) {
      made.choice = Choice::unusable;
    } else if (made.species.empty()) {
      made.choice = Choice::species_unknown;
    } else if (listed.empty()) {
      made.choice = Choice::species_not_listed;
    }
    if (!listed.empty()) made.species = std::move(listed);
  }
  return choices;
}

// Leaves a video out of all splits but the one with most of its frames.
void keep_clips_whole(std::span<const CuratedPicture> pictures, std::vector<Curated>& choices) {
  std::map<std::pair<std::string, std::string>, std::map<std::string, std::int64_t>> frames;
  const auto clip_of = [](const CuratedPicture& picture) {
    return std::pair(species::normalised_source(picture.source), picture.clip);
  };
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (choices[i].choice != Choice::not_drawn || pictures[i].clip.empty()) continue;
    ++frames[clip_of(pictures[i])][pictures[i].split];
  }
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (choices[i].choice != Choice::not_drawn || pictures[i].clip.empty()) continue;
    const auto& sides = frames.at(clip_of(pictures[i]));
    const auto most = std::max_element(sides.begin(), sides.end(), [](const auto& a, const auto& b) {
      return a.second < b.second;  // of equal counts, the first wins
    });
    if (pictures[i].split != most->first) choices[i].choice = Choice::clip_in_other_split;
  }
}

// Sorts pictures of one species in the order in which they are taken: the first frame of every video, then
// the second frame, and so on.
void order_for_drawing(std::span<const CuratedPicture> pictures, std::uint64_t seed,
                       std::vector<std::size_t>& members) {
  std::vector<std::pair<std::string, std::size_t>> shuffled;  // sorted by a hash of seed and name
  shuffled.reserve(members.size());
  for (const std::size_t i : members) {
    shuffled.emplace_back(manifests::sha256(fmt::format("{} {}", seed, pictures[i].image_ref)), i);
  }
  std::sort(shuffled.begin(), shuffled.end());
  std::map<std::pair<std::string, std::string>, std::int64_t> taken;  // frames of a video so far
  std::vector<std::tuple<std::int64_t, std::size_t, std::size_t>> order;
  for (std::size_t place = 0; place < shuffled.size(); ++place) {
    const std::size_t i = shuffled[place].second;
    const CuratedPicture& picture = pictures[i];
    const std::int64_t turn =
        picture.clip.empty() ? 0 : taken[{species::normalised_source(picture.source), picture.clip}]++;
    order.emplace_back(turn, place, i);
  }
  std::sort(order.begin(), order.end());
  std::transform(order.begin(), order.end(), members.begin(),
                 [](const auto& entry) { return std::get<2>(entry); });
}

}  // namespace

std::string_view to_string(Choice choice) {
  return kChoiceNames.at(static_cast<std::size_t>(choice));
}

std::vector<Curated> curate(std::span<const CuratedPicture> pictures, const CurationRule& rule) {
  std::vector<Curated> choices = by_species(pictures, rule);
  keep_clips_whole(pictures, choices);
  for (const auto& [split, total] : rule.pictures) {
    std::map<std::string, std::vector<std::size_t>> members;  // pictures of the split, by species
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const bool may_be_drawn = choices[i].choice == Choice::not_drawn && pictures[i].split == split;
      if (may_be_drawn) members[choices[i].species].push_back(i);
    }
    std::vector<std::int64_t> available;
    available.reserve(members.size());
    for (const auto& [species, list] : members) {
      available.push_back(static_cast<std::int64_t>(list.size()));
    }
    const std::vector<std::int64_t> shares = fair_shares(available, total, rule.cap);
    std::size_t next = 0;
    for (auto& [species, list] : members) {
      order_for_drawing(pictures, rule.seed, list);
      const auto share = static_cast<std::size_t>(shares[next++]);
      for (std::size_t i = 0; i < share; ++i) choices[list[i]].choice = Choice::chosen;
    }
  }
  return choices;
}

std::vector<std::int64_t> fair_shares(std::span<const std::int64_t> available, std::int64_t total,
                                      std::optional<std::int64_t> cap) {
  std::vector<std::int64_t> most(available.begin(), available.end());
  if (cap) {
    for (std::int64_t& count : most) count = std::min(count, *cap);
  }
  const auto sum_at = [&](std::int64_t level) {
    return std::accumulate(most.begin(), most.end(), std::int64_t{0},
                           [level](std::int64_t sum, std::int64_t n) { return sum + std::min(n, level); });
  };
  std::int64_t low = 0;  // the highest level whose sum does not pass the total
  std::int64_t high = most.empty() ? 0 : *std::max_element(most.begin(), most.end());
  while (low < high) {
    const std::int64_t middle = (low + high + 1) / 2;
    if (sum_at(middle) <= total) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  std::int64_t left = std::max<std::int64_t>(0, total - sum_at(low));
  std::vector<std::int64_t> shares;
  for (const std::int64_t count : most) {
    const bool gets_one_more = left > 0 && count > low;
    shares.push_back(std::min(count, low) + (gets_one_more ? 1 : 0));
    if (gets_one_more) --left;
  }
  return shares;
}

}  // namespace q3d::loaders::curation
