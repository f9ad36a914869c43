#include "pipeline/world/species.h"

#include <iterator>
#include <utility>

namespace q3d::pipeline::world {
namespace {

// A row has name, family, synset, Animal Kingdom's name and group, frequency in the order of Frequency, build
// in the order of Build, coats. Colours and builds are chosen by eye.
//
// Frequencies of Animal3D run from 39 to 1, as in the paper's figure (sorrel horses 710, cougars 18);
// SuperAnimal is flatter and has species that Animal3D lacks; Animal Kingdom leans to wild animals.

constexpr std::string_view kCats = "Cat / Lion / Tiger / Cheetah / Leopard / Cheetah / Cougar / Civet cat";
constexpr std::string_view kDogs = "Dog / Wolf / Fox / Coyote / Jackal";
constexpr std::string_view kAntelopes = "Deer / Antelope / Caribou / Moose";
constexpr std::string_view kGoats = "Goat / Sheep / Ibex";
constexpr std::string_view kCattle = "Cow / Buffalo / Bison";
constexpr std::string_view kPigs = "Pig / Boar / Hog";

const Colour kBlack = rgb(30, 27, 26), kWhite = rgb(232, 228, 220), kDark = rgb(58, 46, 38);

// Returns a coat of one colour with a slightly lighter belly.
Coat fur(const Colour& back) {
  Coat coat;
  coat.back = back;
  coat.belly = blend(back, kWhite, 0.25F);
  coat.leg = back;
  coat.muzzle = back * 0.8F;
  coat.crest = back * 0.7F;
  return coat;
}

Coat with_belly(Coat coat, const Colour& belly, float height) {
  coat.belly = belly;
  coat.belly_height = height;
  coat.muzzle = blend(belly, coat.back, 0.3F);
  return coat;
}

Coat with_legs(Coat coat, const Colour& leg, float cover = 1.0F) {
  coat.leg = leg;
  coat.leg_cover = cover;
  return coat;
}

Coat with_muzzle(Coat coat, const Colour& muzzle) {
  coat.muzzle = muzzle;
  return coat;
}

Coat with_marks(Coat coat, Marking marking, const Colour& mark, float scale, float cover) {
  coat.marking = marking;
  coat.mark = mark;
  coat.mark_scale = scale;
  coat.mark_cover = cover;
  return coat;
}

Coat with_mane(Coat coat, const Colour& crest, float mane, float ruff = 0.0F) {
  coat.crest = crest;
  coat.mane = mane;
  coat.ruff = ruff;
  return coat;
}

Coat with_fur(Coat coat, float shag, float gloss) {
  coat.shag = shag;
  coat.gloss = gloss;
  return coat;
}

std::vector<Species> felidae() {
  using enum Marking;
  const Colour tawny = rgb(186, 146, 98), sand = rgb(206, 174, 124);
  return {
      {"siamese cat",
       Family::felidae,
       "n02123597",
       "Domestic Cat",
       kCats,
       {4, 6, 9, 0},
       {0.05F, 0.1F, -0.1F, 0.0F, 0.25F, 0.05F},
       {with_legs(with_muzzle(with_mane(fur(rgb(214, 196, 170)), kDark, 0), kDark), kDark, 0.9F)}},
      {"persian cat",
       Family::felidae,
       "n02123394",
       "Domestic Cat",
       kCats,
       {5, 8, 10, 4},
       {-0.15F, -0.2F, 0.15F, -0.2F, -0.15F, -0.1F},
       {with_fur(fur(rgb(224, 214, 200)), 0.3F, 0.02F), with_fur(fur(rgb(92, 92, 96)), 0.3F, 0.02F),
        with_marks(with_belly(fur(rgb(176, 140, 104)), rgb(222, 208, 188), 0.3F), tabby, rgb(72, 52, 38), 9,
                   0.5F),
        with_marks(fur(kWhite), patches, rgb(198, 116, 54), 3.0F, 0.45F)}},
      {"lion",
       Family::felidae,
       "n02129165",
       "Lion",
       kCats,
       {9, 8, 9, 6},
       {0.05F, 0.05F, 0.1F, 0.15F, -0.2F, 0.1F},
       {with_mane(with_belly(fur(tawny), sand, 0.3F), rgb(92, 58, 32), 0.5F, 0.95F),
        with_mane(with_belly(fur(sand), rgb(224, 206, 172), 0.3F), rgb(150, 112, 72), 0.0F)}},
      {"tiger",
       Family::felidae,
       "n02129604",
       "Tiger",
       kCats,
       {10, 9, 10, 5},
       {0.0F, 0.1F, 0.12F, 0.1F, -0.2F, 0.1F},
       {with_marks(with_belly(fur(rgb(206, 122, 48)), rgb(240, 230, 214), 0.45F), stripes, kBlack, 6.5F,
                   0.32F)}},
      {"leopard",
       Family::felidae,
       "n02128385",
       "Leopard",
       kCats,
       {6, 6, 8, 7},
       {-0.05F, 0.0F, 0.0F, 0.0F, -0.15F, 0.2F},
       {with_marks(with_belly(fur(rgb(204, 160, 96)), rgb(232, 216, 186), 0.35F), rosettes, rgb(40, 30, 24),
                   12, 1)}},
      {"snow leopard",
       Family::felidae,
       "n02128757",
       "Snow Leopard",
       kCats,
       {3, 5, 0, 4},
       {-0.08F, 0.0F, 0.1F, -0.1F, -0.2F, 0.35F},
       {with_fur(
           with_marks(with_belly(fur(rgb(182, 178, 168)), kWhite, 0.4F), rosettes, rgb(72, 68, 66), 10, 1),
           0.25F, 0.02F)}},
      {"cheetah",
       Family::felidae,
       "n02130308",
       "Cheetah",
       kCats,
       {7, 5, 8, 5},
       {0.25F, 0.1F, -0.2F, -0.15F, -0.2F, 0.15F},
       {with_marks(with_belly(fur(rgb(210, 172, 112)), rgb(236, 224, 200), 0.35F), spots, kBlack, 15, 0.8F)}},
      {"bobcat",
       Family::felidae,
       "n02127052",
       "Lynx",
       kCats,
       {2, 4, 6, 4},
       {0.15F, 0.0F, 0.0F, -0.1F, 0.5F, -0.75F},
       {with_fur(with_marks(with_belly(fur(rgb(172, 140, 108)), rgb(226, 214, 196), 0.4F), spots,
                            rgb(92, 70, 52), 14, 0.3F),
                 0.28F, 0.02F)}},
      {"cougar",
       Family::felidae,
       "n02125311",
       "Puma",
       kCats,
       {1, 4, 4, 4},
       {0.08F, 0.1F, -0.02F, -0.05F, -0.05F, 0.15F},
       {with_belly(fur(rgb(176, 128, 86)), rgb(224, 200, 170), 0.35F)}},
  };
}

std::vector<Species> canidae() {
  using enum Marking;
  return {
      {"german shepherd",
       Family::canidae,
       "n02106662",
       "Dog",
       kDogs,
       {16, 10, 10, 0},
       {0.0F, 0.0F, 0.02F, 0.05F, 0.2F, 0.15F},
       {with_legs(with_marks(with_muzzle(fur(rgb(166, 118, 70)), kBlack), patches, kBlack, 1.8F, 0.55F),
                  rgb(182, 134, 84), 0.9F)}},
      {"labrador",
       Family::canidae,
       "n02099712",
       "Dog",
       kDogs,
       {22, 12, 12, 0},
       {-0.05F, -0.05F, 0.12F, 0.0F, -0.1F, 0.05F},
       {fur(rgb(216, 186, 138)), with_fur(fur(rgb(36, 34, 34)), 0.12F, 0.2F), fur(rgb(92, 58, 38))}},
      {"dalmatian",
       Family::canidae,
       "n02110341",
       "Dog",
       kDogs,
       {12, 10, 9, 0},
       {0.1F, 0.05F, -0.05F, 0.0F, -0.05F, 0.0F},
       {with_marks(with_belly(fur(kWhite), kWhite, 0.3F), spots, kBlack, 10, 0.45F)}},
      {"collie",
       Family::canidae,
       "n02106030",
       "Dog",
       kDogs,
       {9, 6, 8, 0},
       {0.0F, 0.05F, 0.1F, 0.15F, 0.0F, 0.15F},
       {with_fur(with_legs(with_belly(fur(rgb(154, 98, 54)), kWhite, 0.5F), kWhite), 0.32F, 0.02F),
        with_fur(with_legs(with_belly(fur(kBlack), kWhite, 0.5F), kWhite), 0.32F, 0.02F)}},
      {"chihuahua",
       Family::canidae,
       "n02085620",
       "Dog",
       kDogs,
       {6, 4, 8, 0},
       {-0.15F, -0.2F, -0.05F, -0.3F, 0.6F, -0.1F},
       {with_belly(fur(rgb(196, 150, 100)), rgb(226, 206, 178), 0.4F),
        with_marks(fur(kWhite), patches, rgb(96, 68, 48), 3.0F, 0.5F)}},
      {"wolf",
       Family::canidae,
       "n02114367",
       "Wolf",
       kDogs,
       {8, 8, 9, 9},
       {0.15F, 0.05F, 0.0F, 0.1F, -0.05F, 0.1F},
       {with_fur(with_legs(with_belly(fur(rgb(124, 114, 102)), rgb(206, 198, 182), 0.4F), rgb(178, 166, 146)),
                 0.35F, 0.02F),
        with_fur(with_belly(fur(rgb(196, 192, 186)), kWhite, 0.3F), 0.3F, 0.02F)}},
      {"red fox",
       Family::canidae,
       "n02119022",
       "Red Fox",
       kDogs,
       {5, 6, 8, 6},
       {-0.05F, 0.0F, -0.1F, 0.05F, 0.35F, 0.45F},
       {with_mane(with_legs(with_belly(fur(rgb(196, 98, 42)), rgb(236, 228, 216), 0.4F), kBlack, 0.95F),
                  kWhite, 0)}},
      {"arctic fox",
       Family::canidae,
       "n02120079",
       "Arctic Fox",
       kDogs,
       {2, 3, 0, 4},
       {-0.2F, -0.1F, 0.15F, -0.15F, -0.1F, 0.4F},
       {with_fur(fur(rgb(230, 230, 232)), 0.2F, 0.02F), with_fur(fur(rgb(128, 118, 112)), 0.3F, 0.02F)}},
  };
}

std::vector<Species> equidae() {
  using enum Marking;
  const Colour bay = rgb(120, 66, 36), chestnut = rgb(150, 82, 44);
  return {
      {"horse",
       Family::equidae,
       "n02389026",
       "Horse",
       "Horse",
       {39, 16, 12, 9},
       {0.03F, 0.05F, 0.0F, 0.0F, -0.05F, 0.05F},
       {with_fur(with_mane(fur(chestnut), rgb(168, 104, 60), 1), 0.1F, 0.25F),
        with_fur(with_legs(with_mane(fur(bay), kBlack, 1), kBlack, 0.9F), 0.1F, 0.25F),
        with_fur(with_mane(fur(rgb(40, 34, 32)), kBlack, 1), 0.1F, 0.25F),
        with_fur(with_mane(fur(rgb(196, 194, 190)), rgb(226, 224, 220), 1), 0.12F, 0.1F),
        with_fur(with_mane(with_marks(fur(kWhite), patches, bay, 1.8F, 0.5F), kDark, 1), 0.1F, 0.15F)}},
      {"zebra",
       Family::equidae,
       "n02391049",
       "Zebra",
       "Zebra",
       {20, 12, 11, 7},
       {-0.06F, -0.08F, 0.06F, 0.0F, 0.1F, -0.05F},
       {with_mane(with_marks(with_belly(fur(rgb(226, 222, 212)), rgb(236, 234, 228), 0.25F), stripes, kBlack,
                             11, 0.5F),
                  rgb(70, 64, 60), 0.9F)}},
      {"donkey",
       Family::equidae,
       "n02390640",
       "Donkey",
       "Horse",
       {4, 4, 0, 3},
       {-0.12F, -0.15F, 0.1F, 0.05F, 0.7F, -0.1F},
       {with_fur(with_mane(with_belly(fur(rgb(140, 130, 120)), rgb(212, 206, 196), 0.45F), kDark, 0.8F),
                 0.25F, 0.02F)}},
  };
}

std::vector<Species> bovidae() {
  using enum Marking;
  return {
      {"cow",
       Family::bovidae,
       "n01887787",
       "Cow",
       kCattle,
       {11, 10, 11, 5},
       {0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F},
       {with_marks(fur(kWhite), patches, kBlack, 1.7F, 0.55F),
        with_marks(fur(kWhite), patches, rgb(140, 74, 42), 1.7F, 0.6F), fur(rgb(166, 112, 70)),
        with_muzzle(fur(rgb(214, 196, 168)), rgb(190, 150, 140))}},
      {"ox",
       Family::bovidae,
       "n02403003",
       "Ox",
       kCattle,
       {7, 6, 8, 0},
       {-0.08F, -0.05F, 0.12F, 0.05F, 0.0F, 0.05F},
       {fur(rgb(128, 82, 52)), fur(rgb(64, 48, 40)), with_belly(fur(rgb(186, 172, 152)), kWhite, 0.3F)}},
      {"buffalo",
       Family::bovidae,
       "n02408429",
       "Water Buffalo",
       kCattle,
       {3, 5, 8, 6},
       {-0.15F, -0.1F, 0.2F, 0.1F, 0.2F, -0.1F},
       {with_fur(fur(rgb(62, 56, 54)), 0.2F, 0.1F)}},
      {"bison",
       Family::bovidae,
       "n02410509",
       "Bison",
       kCattle,
       {3, 4, 0, 6},
       {-0.2F, -0.2F, 0.25F, -0.05F, -0.2F, -0.3F},
       {with_mane(with_fur(fur(rgb(104, 72, 48)), 0.4F, 0.02F), rgb(52, 36, 28), 0.8F, 0.9F)}},
      {"sheep",
       Family::bovidae,
       "n02412080",
       "Sheep",
       kGoats,
       {6, 6, 9, 5},
       {-0.15F, 0.05F, 0.15F, -0.1F, 0.0F, -0.5F},
       {with_fur(with_muzzle(with_legs(fur(rgb(218, 208, 188)), kDark, 0.8F), kDark), 0.4F, 0.0F),
        with_fur(fur(rgb(226, 220, 206)), 0.4F, 0.0F)}},
      {"bighorn",
       Family::bovidae,
       "n02415577",
       "Ibex",
       kGoats,
       {4, 5, 0, 7},
       {0.1F, 0.1F, 0.0F, -0.05F, -0.05F, -0.7F},
       {with_belly(fur(rgb(140, 110, 82)), rgb(220, 210, 194), 0.4F)}},
      {"antelope",
       Family::bovidae,
       "n02422699",
       "Impala",
       kAntelopes,
       {5, 6, 10, 9},
       {0.3F, 0.35F, -0.25F, -0.1F, 0.25F, -0.4F},
       {with_belly(fur(rgb(178, 116, 66)), rgb(238, 230, 216), 0.45F),
        with_belly(fur(rgb(196, 152, 102)), rgb(240, 234, 222), 0.5F)}},
  };
}

std::vector<Species> hippopotamidae() {
  return {
      {"hippopotamus",
       Family::hippopotamidae,
       "n02398521",
       "Hippopotamus",
       "Hippopotamus",
       {8, 6, 8, 5},
       {0.0F, 0.0F, 0.05F, 0.05F, 0.0F, 0.0F},
       {with_fur(with_belly(fur(rgb(112, 92, 88)), rgb(172, 132, 122), 0.4F), 0.08F, 0.3F),
        with_fur(fur(rgb(92, 80, 80)), 0.08F, 0.35F)}},
      {"rhinoceros",
       Family::hippopotamidae,
       "n02391994",
       "Rhinoceros",
       "Rhinoceros",
       {0, 3, 8, 5},
       {0.3F, 0.35F, -0.08F, 0.12F, 0.6F, 0.6F},
       {with_fur(fur(rgb(134, 128, 120)), 0.12F, 0.05F)}},
      {"pig",
       Family::hippopotamidae,
       "n02395406",
       "Pig",
       kPigs,
       {0, 4, 8, 3},
       {0.15F, 0.1F, -0.2F, -0.1F, 0.8F, 0.3F},
       {with_fur(fur(rgb(222, 172, 160)), 0.08F, 0.08F),
        with_fur(with_marks(fur(rgb(222, 176, 164)), Marking::patches, kBlack, 2.2F, 0.4F), 0.1F, 0.05F)}},
      {"warthog",
       Family::hippopotamidae,
       "n02397096",
       "Warthog",
       kPigs,
       {4, 4, 0, 5},
       {0.35F, 0.2F, -0.28F, 0.1F, 0.7F, 0.9F},
       {with_mane(with_fur(fur(rgb(116, 98, 84)), 0.3F, 0.02F), rgb(70, 52, 42), 0.9F)}},
  };
}

}  // namespace

std::span<const Species> species_table() {
  static const std::vector<Species> kTable = [] {
    std::vector<Species> all;
    for (std::vector<Species> family : {felidae(), canidae(), equidae(), bovidae(), hippopotamidae()}) {
      std::move(family.begin(), family.end(), std::back_inserter(all));
    }
    return all;
  }();
  return kTable;
}

}  // namespace q3d::pipeline::world
