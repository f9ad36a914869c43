// The tables of names behind species.h. That header and each table state their sources.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <utility>

#include "manifests/sample.h"

namespace q3d::loaders::species::table {

// The names are those of the four datasets, of AP-10K (54 species) and of ImageNet's classes.
inline constexpr std::string_view kFelidae[] = {
    "bobcat", "caracal", "cat",    "cheetah", "cougar", "jaguar", "jaguarundi", "kitten", "leopard", "lion",
    "lynx",   "margay",  "ocelot", "panther", "puma",   "serval", "tabby",      "tiger",  "wildcat"};
inline constexpr std::string_view kCanidae[] = {
    "chihuahua", "collie", "coyote",          "dalmatian", "dhole", "dingo",     "dog",
    "fennec",    "fox",    "german shepherd", "jackal",    "puppy", "retriever", "wolf"};
inline constexpr std::string_view kEquidae[] = {"ass",    "donkey", "foal",   "horse",  "kiang", "mule",
                                                "onager", "pony",   "quagga", "sorrel", "zebra"};
inline constexpr std::string_view kBovidae[] = {
    "antelope",   "bighorn", "bison",  "blackbuck", "bongo",      "buffalo", "bull",    "cattle",
    "chamois",    "cow",     "eland",  "gaur",      "gazelle",    "gemsbok", "gnu",     "goat",
    "hartebeest", "ibex",    "impala", "kudu",      "lamb",       "markhor", "mouflon", "nilgai",
    "nyala",      "oryx",    "ox",     "ram",       "saiga",      "serow",   "sheep",   "springbok",
    "tahr",       "takin",   "topi",   "waterbuck", "wildebeest", "yak",     "zebu"};
inline constexpr std::string_view kHippopotamidae[] = {"hippo", "hippopotamus"};
// Animals outside the five families. The second block holds names whose last word would mislead.
inline constexpr std::string_view kOtherAnimals[] = {"aardvark",
                                                     "alpaca",
                                                     "anteater",
                                                     "armadillo",
                                                     "badger",
                                                     "bear",
                                                     "beaver",
                                                     "binturong",
                                                     "boar",
                                                     "camel",
                                                     "capybara",
                                                     "caribou",
                                                     "civet",
                                                     "coati",
                                                     "deer",
                                                     "elephant",
                                                     "elk",
                                                     "ermine",
                                                     "ferret",
                                                     "fossa",
                                                     "giraffe",
                                                     "hamster",
                                                     "hare",
                                                     "hedgehog",
                                                     "hog",
                                                     "hyena",
                                                     "koala",
                                                     "llama",
                                                     "marmot",
                                                     "marten",
                                                     "meerkat",
                                                     "mink",
                                                     "mole",
                                                     "mongoose",
                                                     "moose",
                                                     "mouse",
                                                     "muntjac",
                                                     "okapi",
                                                     "opossum",
                                                     "otter",
                                                     "panda",
                                                     "pangolin",
                                                     "peccary",
                                                     "pig",
                                                     "porcupine",
                                                     "pronghorn",
                                                     "rabbit",
                                                     "raccoon",
                                                     "racoon",
                                                     "rat",
                                                     "reindeer",
                                                     "rhino",
                                                     "rhinoceros",
                                                     "rodent",
                                                     "skunk",
                                                     "sloth",
                                                     "squirrel",
                                                     "stoat",
                                                     "tamandua",
                                                     "tapir",
                                                     "vicuna",
                                                     "warthog",
                                                     "weasel",
                                                     "wolverine",
                                                     "wombat",
                                                     "bear cat",
                                                     "civet cat",
                                                     "pronghorn antelope",
                                                     "prairie dog",
                                                     "sea lion",
                                                     "tasmanian tiger",
                                                     "tasmanian wolf"};

struct FamilyNames {
  manifests::Family family;
  std::span<const std::string_view> names;
};
inline constexpr std::array<FamilyNames, 6> kFamilies{{{manifests::Family::none, kOtherAnimals},
                                                       {manifests::Family::felidae, kFelidae},
                                                       {manifests::Family::canidae, kCanidae},
                                                       {manifests::Family::equidae, kEquidae},
                                                       {manifests::Family::bovidae, kBovidae},
                                                       {manifests::Family::hippopotamidae, kHippopotamidae}}};

// Words that exclude a record of Animal Kingdom or AP-10K. "Echina" is the dataset's own spelling of echidna.
inline constexpr std::string_view kNotQuadrupeds[] = {
    "bird",     "eagle",   "primate",  "monkey",   "macaque", "baboon",  "chimpanzee", "gorilla", "orangutan",
    "langur",   "lemur",   "gibbon",   "marmoset", "tamarin", "ape",     "alouatta",   "uakari",  "human",
    "kangaroo", "wallaby", "platypus", "echidna",  "echina",  "bat",     "flying fox", "whale",   "dolphin",
    "porpoise", "orca",    "seal",     "sea lion", "walrus",  "manatee", "dugong"};

using NamePair = std::pair<std::string_view, std::string_view>;

// SuperAnimal-Quadruped80K's sub-datasets of one animal, lower case, letters and digits only.
inline constexpr NamePair kSourcesOfOneSpecies[] = {
    {"stanforddogs", "dog"}, {"stanfordextra", "dog"}, {"cheetah", "cheetah"}, {"acinoset", "cheetah"},
    {"horse10", "horse"},    {"horse30", "horse"},     {"irodents", "rodent"}, {"irodent", "rodent"}};

// AnimalPose's own pictures (ca110.jpeg); the rest of that set has the names of PASCAL VOC.
inline constexpr NamePair kAnimalPosePrefixes[] = {
    {"ca", "cat"}, {"co", "cow"}, {"do", "dog"}, {"ho", "horse"}, {"sh", "sheep"}};

// ImageNet (ILSVRC 2012): synsets of the dog breeds, which are StanfordDogs' too, and of other quadrupeds.
inline constexpr int kFirstDogSynset = 2085620;  // Chihuahua
inline constexpr int kLastDogSynset = 2113978;   // Mexican hairless
inline constexpr std::pair<int, std::string_view> kSynsets[] = {{2114367, "timber wolf"},
                                                                {2114548, "white wolf"},
                                                                {2114712, "red wolf"},
                                                                {2114855, "coyote"},
                                                                {2115641, "dingo"},
                                                                {2115913, "dhole"},
                                                                {2116738, "african hunting dog"},
                                                                {2117135, "hyena"},
                                                                {2119022, "red fox"},
                                                                {2119789, "kit fox"},
                                                                {2120079, "arctic fox"},
                                                                {2120505, "grey fox"},
                                                                {2123045, "tabby"},
                                                                {2123159, "tiger cat"},
                                                                {2123394, "persian cat"},
                                                                {2123597, "siamese cat"},
                                                                {2124075, "egyptian cat"},
                                                                {2125311, "cougar"},
                                                                {2127052, "lynx"},
                                                                {2128385, "leopard"},
                                                                {2128757, "snow leopard"},
                                                                {2128925, "jaguar"},
                                                                {2129165, "lion"},
                                                                {2129604, "tiger"},
                                                                {2130308, "cheetah"},
                                                                {2132136, "brown bear"},
                                                                {2133161, "black bear"},
                                                                {2134084, "polar bear"},
                                                                {2134418, "sloth bear"},
                                                                {2389026, "sorrel"},
                                                                {2391049, "zebra"},
                                                                {2395406, "hog"},
                                                                {2396427, "wild boar"},
                                                                {2397096, "warthog"},
                                                                {2398521, "hippopotamus"},
                                                                {2403003, "ox"},
                                                                {2408429, "water buffalo"},
                                                                {2410509, "bison"},
                                                                {2412080, "ram"},
                                                                {2415577, "bighorn"},
                                                                {2417914, "ibex"},
                                                                {2422106, "hartebeest"},
                                                                {2422699, "impala"},
                                                                {2423022, "gazelle"},
                                                                {2437312, "arabian camel"},
                                                                {2437616, "llama"},
                                                                {2504013, "indian elephant"},
                                                                {2504458, "african elephant"},
                                                                {2509815, "red panda"},
                                                                {2510455, "giant panda"}};

}  // namespace q3d::loaders::species::table
