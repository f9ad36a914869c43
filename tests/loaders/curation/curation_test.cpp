// The rule against choices counted by hand.
#include "loaders/curation/curation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "loaders/curation/clip.h"

namespace q3d::loaders::curation {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::int64_t> shares(std::vector<std::int64_t> available, std::int64_t total,
                                 std::optional<std::int64_t> cap = {}) {
  return fair_shares(available, total, cap);
}

TEST(FairShares, fill_up_to_one_level) {
  EXPECT_THAT(shares({5, 100, 20}, 60), ElementsAre(5, 35, 20));  // 60 - 5 - 20 = 35
  EXPECT_THAT(shares({5, 100, 20}, 45), ElementsAre(5, 20, 20));
  EXPECT_THAT(shares({10, 10, 10}, 16), ElementsAre(6, 5, 5));  // 16 = 3 x 5 + 1: the first gets it
  EXPECT_THAT(shares({4, 10, 10}, 15), ElementsAre(4, 6, 5));
  EXPECT_THAT(shares({3, 3}, 1), ElementsAre(1, 0));
}

TEST(FairShares, take_all_where_there_is_less_and_stop_at_the_cap) {
  EXPECT_THAT(shares({1, 2}, 10), ElementsAre(1, 2));
  EXPECT_THAT(shares({5, 100, 20}, 60, 8), ElementsAre(5, 8, 8));
  EXPECT_THAT(shares({5, 100, 20}, 9, 8), ElementsAre(3, 3, 3));
  EXPECT_THAT(shares({0, 7}, 5), ElementsAre(0, 5));
  EXPECT_THAT(shares({}, 5), IsEmpty());
}

CuratedPicture picture(const std::string& split, const std::string& name, const std::string& species,
                       const std::string& clip = "") {
  return {split, name, "video", species, clip, true};
}

// `count` of them, named prefix0, prefix1, ...
void add(std::vector<CuratedPicture>& pictures, int count, const std::string& split,
         const std::string& prefix, const std::string& species, const std::string& clip = "") {
  for (int i = 0; i < count; ++i) {
    pictures.push_back(picture(split, prefix + std::to_string(i), species, clip));
  }
}

CurationRule rule(std::int64_t train, std::int64_t test) {
  CurationRule made;
  made.species = {{"bear", {"bear"}}, {"cow", {"cow", "ox"}}, {"dog", {"dog", "german shepherd"}}};
  made.pictures = {{"train", train}, {"test", test}};
  return made;
}

TEST(Curate, names_count_as_their_species_by_their_last_words) {
  const std::vector<CuratedPicture> pictures{picture("train", "a", "polar bear"),
                                             picture("train", "b", "ox"),
                                             picture("train", "c", "German+Shepherd"),
                                             picture("train", "d", "bear cat"),
                                             picture("train", "e", ""),
                                             {"train", "f", "", "dog", "", false}};
  const auto choices = curate(pictures, rule(10, 10));
  EXPECT_EQ(choices[0].species, "bear");
  EXPECT_EQ(choices[1].species, "cow");
  EXPECT_EQ(choices[2].species, "dog");
  for (const std::size_t i : {0U, 1U, 2U}) EXPECT_EQ(choices[i].choice, Choice::chosen) << i;
  EXPECT_EQ(choices[3].choice, Choice::species_not_listed);
  EXPECT_EQ(choices[3].species, "bear cat");
  EXPECT_EQ(choices[4].choice, Choice::species_unknown);
  EXPECT_EQ(choices[5].choice, Choice::unusable);
}

TEST(Curate, each_split_is_drawn_from_itself_and_balanced) {
  std::vector<CuratedPicture> pictures;
  add(pictures, 30, "train", "bear", "bear");
  add(pictures, 4, "train", "cow", "cow");
  add(pictures, 8, "train", "dog", "dog");
  add(pictures, 2, "test", "tbear", "bear");
  add(pictures, 9, "test", "tdog", "dog");
  const auto choices = curate(pictures, rule(20, 6));
  std::map<std::pair<std::string, std::string>, int> chosen;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (choices[i].choice == Choice::chosen) ++chosen[{pictures[i].split, choices[i].species}];
  }
  const std::map<std::pair<std::string, std::string>, int> expected{{{"test", "bear"}, 2},
                                                                    {{"test", "dog"}, 4},
                                                                    {{"train", "bear"}, 8},
                                                                    {{"train", "cow"}, 4},
                                                                    {{"train", "dog"}, 8}};
  EXPECT_EQ(chosen, expected);
}

TEST(Curate, a_video_stays_whole_on_the_side_with_most_of_it) {
  std::vector<CuratedPicture> pictures;
  add(pictures, 3, "train", "a", "bear", "run");
  add(pictures, 2, "test", "b", "bear", "run");
  add(pictures, 2, "train", "c", "cow", "walk");  // as many on both sides: test is first in the alphabet
  add(pictures, 2, "test", "d", "cow", "walk");
  add(pictures, 1, "test", "e", "dog", "run");
  pictures.back().source = "another";  // its video of the same name is another
  const auto choices = curate(pictures, rule(100, 100));
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const char kind = pictures[i].image_ref[0];
    EXPECT_EQ(choices[i].choice, kind == 'b' || kind == 'c' ? Choice::clip_in_other_split : Choice::chosen)
        << pictures[i].image_ref;
  }
}

TEST(Curate, every_video_gives_a_frame_before_any_gives_a_second) {
  std::vector<CuratedPicture> pictures;
  add(pictures, 50, "train", "run", "bear", "run");
  add(pictures, 50, "train", "walk", "bear", "walk");
  add(pictures, 3, "train", "single", "bear");
  const auto choices = curate(pictures, rule(9, 1));
  std::map<std::string, int> chosen;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (choices[i].choice == Choice::chosen) ++chosen[pictures[i].clip];
  }
  const std::map<std::string, int> expected{{"", 3}, {"run", 3}, {"walk", 3}};
  EXPECT_EQ(chosen, expected);
}

std::set<std::string> chosen_names(const std::vector<CuratedPicture>& pictures, const CurationRule& made) {
  const auto choices = curate(pictures, made);
  std::set<std::string> names;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (choices[i].choice == Choice::chosen) names.insert(pictures[i].image_ref);
  }
  return names;
}

TEST(Curate, seed_and_names_decide_and_nothing_else) {
  std::vector<CuratedPicture> pictures;
  add(pictures, 60, "train", "bear", "bear", "run");
  add(pictures, 60, "train", "dog", "dog");
  CurationRule made = rule(40, 1);
  const auto names = chosen_names(pictures, made);
  ASSERT_EQ(names.size(), 40U);
  std::reverse(pictures.begin(), pictures.end());
  EXPECT_EQ(chosen_names(pictures, made), names);
  made.seed = 1;
  EXPECT_NE(chosen_names(pictures, made), names);
}

TEST(Curate, a_name_of_two_species_is_refused) {
  CurationRule made = rule(1, 1);
  made.species["wolf"] = {"German Shepherd"};
  try {
    curate({}, made);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("\"German Shepherd\" is listed for dog and for wolf"));
  }
}

TEST(Clip, is_the_name_without_numbers) {
  EXPECT_EQ(source_stem("images/horse_11361_13677.jpg"), "horse_11361");
  EXPECT_EQ(source_stem("2010_001705.jpg"), "2010");
  EXPECT_EQ(source_stem("a\\b\\img0012.png"), "img0012");
  EXPECT_EQ(source_stem("_12.png"), "_12");
  EXPECT_EQ(clip_of_frame("videos/run_0012_345.png"), "videos/run");
  EXPECT_EQ(clip_of_frame("videos/run_0013_999.png"), "videos/run");
  EXPECT_EQ(clip_of_frame("videos/walk-0012_345.png"), "videos/walk");
  EXPECT_EQ(clip_of_frame("run/0012_345.png"), "run");
  EXPECT_EQ(clip_of_frame("img00123_456.jpg"), "img");
  EXPECT_EQ(clip_of_frame("0012_345.png"), "");
}

}  // namespace
}  // namespace q3d::loaders::curation
