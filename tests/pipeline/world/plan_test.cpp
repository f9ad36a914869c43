#include "pipeline/world/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <regex>
#include <set>

namespace q3d::pipeline::world {
namespace {

TEST(ShareOut, GivesLargestRemaindersAndTheExactTotal) {
  EXPECT_EQ(share_out(10, {1.0, 1.0, 1.0}), (std::vector<int>{4, 3, 3}));
  EXPECT_EQ(share_out(7, {5.0, 0.0, 2.0}), (std::vector<int>{5, 0, 2}));
  EXPECT_EQ(share_out(3, {0.5, 0.3, 0.2}), (std::vector<int>{1, 1, 1}));  // 1.5, 0.9, 0.6
  EXPECT_THROW(share_out(3, {0.0, 0.0}), std::invalid_argument);
}

std::map<int, int> species_counts(const std::vector<PicturePlan>& plans) {
  std::map<int, int> counts;
  for (const PicturePlan& plan : plans) ++counts[plan.species];
  return counts;
}

TEST(PlanSplit, Animal3dHasALongTailOfThirtyNineToOne) {
  const auto counts = species_counts(plan_split(SetId::animal3d, false, 4.0, 1));
  const auto [least, most] = std::minmax_element(
      counts.begin(), counts.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  EXPECT_NEAR(static_cast<double>(most->second) / least->second, 39.0, 4.0);
  EXPECT_EQ(species_table()[static_cast<std::size_t>(most->first)].name, "horse");
  EXPECT_EQ(species_table()[static_cast<std::size_t>(least->first)].name, "cougar");
}

TEST(PlanSplit, EverySetShowsAllFamiliesAndTheWorldEnoughSpecies) {
  EXPECT_GE(species_table().size(), 23U);
  for (int set = 0; set < kSets; ++set) {
    std::set<Family> families;
    std::set<int> species;
    for (const PicturePlan& plan : plan_split(static_cast<SetId>(set), true, 1.0, 5)) {
      families.insert(species_table()[static_cast<std::size_t>(plan.species)].family);
      species.insert(plan.species);
    }
    EXPECT_EQ(families.size(), static_cast<std::size_t>(kFamilies)) << "set " << set;
    EXPECT_GE(species.size(), 20U) << "set " << set;
  }
}

TEST(PlanSplit, DefaultCountsKeepWhatEvaluationNeeds) {
  const auto count = [](SetId set, bool test, double share) {
    return static_cast<int>(plan_split(set, test, share, 0).size());
  };
  for (const SetId set : {SetId::animal3d, SetId::ctrlani3d, SetId::animal_kingdom}) {
    EXPECT_GE(count(set, true, 1.0), 500);
  }
  EXPECT_EQ(count(SetId::superanimal, false, 1.0), 1400);
  EXPECT_EQ(count(SetId::superanimal, true, 1.0), 600);
  EXPECT_EQ(count(SetId::animal_kingdom, false, 1.0), 0);
  EXPECT_EQ(count(SetId::superanimal, false, 0.05), 70);
  EXPECT_EQ(count(SetId::superanimal, true, 0.0001), 1);
}

TEST(PlanSplit, NamesAreUniqueInTheWorldAndTheSameForTheSameSeed) {
  std::set<std::string> images, masks, stems;
  for (int set = 0; set < kSets; ++set) {
    for (const bool test : {false, true}) {
      const auto plans = plan_split(static_cast<SetId>(set), test, 1.0, 3);
      const auto again = plan_split(static_cast<SetId>(set), test, 1.0, 3);
      ASSERT_EQ(plans.size(), again.size());
      for (std::size_t i = 0; i < plans.size(); ++i) {
        EXPECT_EQ(plans[i].image, again[i].image);
        EXPECT_TRUE(images.insert(std::to_string(set) + plans[i].image).second) << plans[i].image;
        EXPECT_TRUE(masks.insert(plans[i].mask).second) << plans[i].mask;
        std::smatch synset;  // one ImageNet number is one photograph, whatever the set
        if (std::regex_search(plans[i].image, synset, std::regex("n\\d{8}_\\d+"))) {
          EXPECT_TRUE(stems.insert(synset[0]).second) << plans[i].image;
        }
      }
    }
  }
}

TEST(PlanSplit, SuperAnimalNamesTellTheCollection) {
  int absolute = 0, awa = 0;
  for (const PicturePlan& plan : plan_split(SetId::superanimal, false, 1.0, 3)) {
    const std::string id = "_" + std::to_string(plan.image_id) + ".jpg";
    EXPECT_TRUE(plan.listed.ends_with(id)) << plan.listed;
    EXPECT_EQ(plan.image, "images/" + plan.listed.substr(plan.listed.rfind('/') + 1));
    absolute += plan.listed.starts_with('/') ? 1 : 0;
    awa += std::regex_match(plan.listed, std::regex("[a-z]+(\\+[a-z]+)?_\\d+_\\d+\\.jpg")) ? 1 : 0;
  }
  EXPECT_GT(absolute, 0);
  EXPECT_GT(awa, 700);
}

TEST(PlanSplit, FramesOfOneFilmShowOneAnimal) {
  std::map<std::string, std::pair<int, int>> of_film;
  for (const PicturePlan& plan : plan_split(SetId::animal_kingdom, true, 1.0, 3)) {
    const std::string film = plan.listed.substr(0, plan.listed.find('/'));
    const auto [at, added] = of_film.try_emplace(film, plan.species, plan.individual);
    EXPECT_EQ(at->second, std::pair(plan.species, plan.individual)) << plan.listed;
  }
  EXPECT_EQ(of_film.size(), 125U);
}

}  // namespace
}  // namespace q3d::pipeline::world
