#include "loaders/species/species.h"

#include <gtest/gtest.h>

namespace q3d::loaders::species {
namespace {

using manifests::Family;

TEST(Species, are_read_from_picture_names) {
  const auto name = [](const char* file, const char* source = "") {
    return species_of_picture(file, source);
  };
  EXPECT_EQ(name("giant+panda_10632_26152.jpg"), "giant panda");
  EXPECT_EQ(name("images/horse_11361_13677.jpg"), "horse");
  EXPECT_EQ(name("/disk/images/Persian+Cat_10001_5.JPG"), "persian cat");
  EXPECT_EQ(name("images/train/n02412080/n02412080_12159.JPEG"), "ram");
  EXPECT_EQ(name("n02096177_7318_99.jpg"), "dog");    // a breed
  EXPECT_EQ(name("n02085620_1.jpg"), "dog");          // the first of them
  EXPECT_EQ(name("n02113978_1.jpg"), "dog");          // the last
  EXPECT_EQ(name("n02114367_1.jpg"), "timber wolf");  // the synset after them
  EXPECT_EQ(name("n99999999_1.jpg"), "");
  EXPECT_EQ(name("000000015956_horse.png"), "horse");
  EXPECT_EQ(name("000000000004_812.jpg"), "");  // AP-10K says nothing
  EXPECT_EQ(name("frame_1_2.jpg"), "");         // no animal of the table
  EXPECT_EQ(name("img0012_3.png", "horse-10"), "horse");
  EXPECT_EQ(name("x.png", "Stanford_Dogs"), "dog");
  EXPECT_EQ(name("ca110_4.jpeg"), "cat");
  EXPECT_EQ(name("sh12.jpeg"), "sheep");
  EXPECT_EQ(name("case.jpeg"), "");
  EXPECT_EQ(name(""), "");
}

TEST(Species, have_zoological_families) {
  const auto family = [](const char* species) { return family_of_species(species); };
  EXPECT_EQ(family("siamese cat"), Family::felidae);
  EXPECT_EQ(family("dalmatian"), Family::canidae);
  EXPECT_EQ(family("zebra"), Family::equidae);
  EXPECT_EQ(family("sheep"), Family::bovidae);
  EXPECT_EQ(family("hippopotamus"), Family::hippopotamidae);
  EXPECT_EQ(family("polar bear"), Family::none);
  EXPECT_EQ(family("giraffe"), Family::none);
  EXPECT_EQ(family("prairie dog"), Family::none);
  EXPECT_EQ(family("sea lion"), Family::none);
  EXPECT_EQ(family("unicorn"), std::nullopt);
  EXPECT_EQ(family(""), std::nullopt);
}

TEST(Species, every_species_of_awa_pose_is_in_the_table) {
  for (const char* species : {"antelope",
                              "bobcat",
                              "buffalo",
                              "chihuahua",
                              "collie",
                              "cow",
                              "dalmatian",
                              "deer",
                              "elephant",
                              "fox",
                              "german shepherd",
                              "giant panda",
                              "giraffe",
                              "grizzly bear",
                              "hippopotamus",
                              "horse",
                              "leopard",
                              "lion",
                              "moose",
                              "otter",
                              "ox",
                              "persian cat",
                              "pig",
                              "polar bear",
                              "rabbit",
                              "raccoon",
                              "rat",
                              "rhinoceros",
                              "sheep",
                              "siamese cat",
                              "skunk",
                              "squirrel",
                              "tiger",
                              "weasel",
                              "wolf",
                              "zebra"}) {
    EXPECT_TRUE(family_of_species(species).has_value()) << species;
  }
}

TEST(Species, names_are_normalised) {
  EXPECT_EQ(normalised_species("  German+Shepherd "), "german shepherd");
  EXPECT_EQ(normalised_species("ARCTIC__Fox"), "arctic fox");
  EXPECT_EQ(normalised_source("AwA-Pose"), "awapose");
}

}  // namespace
}  // namespace q3d::loaders::species
