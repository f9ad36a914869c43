// Guessed topologies, against the shipped ones, whose maps come from published tables, and in the spellings
// of other tools.
#include "loaders/keypoints/guess.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "loaders/keypoints/keypoint_words.h"
#include "loaders/keypoints/topology_file.h"
#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::keypoints {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

std::string source_of(const Topology& topology, const std::string& target) {
  const std::vector<std::string>& names = keypoints::topology("animal3d26").keypoints;
  const auto place = std::find(names.begin(), names.end(), target) - names.begin();
  const int source = topology.source.at(static_cast<std::size_t>(place));
  return source < 0 ? "" : topology.keypoints[static_cast<std::size_t>(source)];
}

struct Spelling {
  const char* name;
  Side side;
  End end;
  Part part;
};

class Words : public ::testing::TestWithParam<Spelling> {};

TEST_P(Words, say_side_end_and_part) {
  const KeypointWords words = words_of(GetParam().name);
  EXPECT_EQ(words.side, GetParam().side);
  EXPECT_EQ(words.end, GetParam().end);
  EXPECT_EQ(words.part, GetParam().part);
}

INSTANTIATE_TEST_SUITE_P(Spellings, Words,
                         ::testing::Values(Spelling{"L_F_Paw", Side::left, End::front, Part::paw},
                                           Spelling{"hoof_br", Side::right, End::back, Part::paw},
                                           Spelling{"leftFrontPaw", Side::left, End::front, Part::paw},
                                           Spelling{"LFPaw", Side::left, End::front, Part::paw},
                                           Spelling{"RBackPaw", Side::right, End::back, Part::paw},
                                           Spelling{"Nearhindhock", Side::left, End::back, Part::tarsus},
                                           Spelling{"Offfrontfoot", Side::right, End::front, Part::paw},
                                           Spelling{"front_left_thai", Side::left, End::front, Part::thigh},
                                           Spelling{"rightear", Side::right, End::none, Part::ear},
                                           Spelling{"R_EarBase", Side::right, End::none, Part::ear},
                                           Spelling{"right_earend", Side::right, End::none, Part::ear_tip},
                                           Spelling{"Root of tail", Side::none, End::none, Part::tail_base},
                                           Spelling{"Tail_Mid_Back", Side::none, End::back, Part::tail_mid},
                                           Spelling{"snout", Side::none, End::none, Part::nose},
                                           Spelling{"upper_jaw", Side::none, End::none, Part::none},
                                           Spelling{"rearpaw_l", Side::left, End::back, Part::paw},
                                           Spelling{"belly_bottom", Side::none, End::none, Part::none}));

// A guess must not contradict a published map, but it may leave keypoints out.
TEST(Guess, agrees_with_the_published_maps) {
  const std::vector<std::string>& targets = topology("animal3d26").keypoints;
  for (const char* name : {"superanimal_quadruped", "animalpose_mmpose", "animal3d"}) {
    const Topology published = read_topology_file(name);
    const Topology guessed = guess_topology("guess", published.keypoints).topology;
    EXPECT_EQ(guessed.flip, published.flip) << name;
    int same = 0;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      if (guessed.source[i] < 0) continue;
      if (published.source[i] >= 0) {
        EXPECT_EQ(guessed.source[i], published.source[i]) << name << ": " << targets[i];
        ++same;
      }
    }
    EXPECT_GE(same, 14) << name;
  }
}

TEST(Guess, of_a_labs_names) {
  const std::vector<std::string> names{"snout",    "eye_l",   "eye_r",   "withers", "tail_base", "carpus_l",
                                       "carpus_r", "hoof_fl", "hoof_fr", "hoof_bl", "hoof_br"};
  const TopologyGuess guess = guess_topology("goats", names);
  EXPECT_EQ(source_of(guess.topology, "nose"), "snout");
  EXPECT_EQ(source_of(guess.topology, "left_eye"), "eye_l");
  EXPECT_EQ(source_of(guess.topology, "right_front_knee"), "carpus_r");
  EXPECT_EQ(source_of(guess.topology, "left_front_paw"), "hoof_fl");
  EXPECT_EQ(source_of(guess.topology, "right_back_paw"), "hoof_br");
  EXPECT_EQ(source_of(guess.topology, "tail_base"), "tail_base");
  EXPECT_EQ(guess.topology.flip[1], 2);
  EXPECT_EQ(guess.topology.flip[0], 0);
  EXPECT_THAT(guess.doubts, Contains(HasSubstr("no counterpart among the 26 was found for withers")));
}

TEST(Guess, names_the_knee_that_may_be_two_things) {
  const std::vector<std::string> with_hock{"l_back_knee", "r_back_knee", "l_hock", "r_hock"};
  const TopologyGuess guess = guess_topology("a", with_hock);
  EXPECT_EQ(source_of(guess.topology, "left_back_thigh"), "l_back_knee");
  EXPECT_EQ(source_of(guess.topology, "left_back_knee"), "l_hock");
  EXPECT_THAT(guess.doubts, Contains(HasSubstr("\"l_back_knee\" -> left_back_thigh: is this the true knee")));
}

TEST(Guess, doubts_that_a_name_has_no_mirror_image) {
  const std::vector<std::string> names{"left_eye", "right_ear", "left_ear"};
  const TopologyGuess guess = guess_topology("a", names);
  EXPECT_THAT(guess.doubts,
              Contains(HasSubstr("\"left_eye\" is on one side, but no name looks like its mirror image")));
}

TEST(Guess, doubts_two_names_for_one_of_the_26) {
  const std::vector<std::string> names{"snout", "nose_tip"};
  const TopologyGuess guess = guess_topology("a", names);
  EXPECT_EQ(source_of(guess.topology, "nose"), "snout");
  EXPECT_THAT(guess.doubts, Contains(HasSubstr("\"snout\" and \"nose_tip\" both look like nose")));
}

TEST(Guess, refuses_no_names_and_names_that_occur_twice) {
  EXPECT_THROW(guess_topology("a", {}), std::invalid_argument);
  const std::vector<std::string> twice{"nose", "nose"};
  EXPECT_THROW(guess_topology("a", twice), std::invalid_argument);
}

TEST(Guess, its_file_is_read_as_the_same_topology) {
  const q3d::testing::ScratchDir scratch;
  for (const char* name : {"superanimal_quadruped", "animalpose", "ap10k"}) {
    const Topology published = read_topology_file(name);
    formats::testing_files::write_text(scratch.path() / "t.json", topology_json(published, "about").dump(2));
    const Topology read = read_topology_file(scratch.path() / "t.json");
    EXPECT_EQ(read.name, published.name);
    EXPECT_EQ(read.keypoints, published.keypoints);
    EXPECT_EQ(read.flip, published.flip);
    EXPECT_EQ(read.source, published.source);
    EXPECT_EQ(read.weights, published.weights);
  }
}

}  // namespace
}  // namespace q3d::loaders::keypoints
