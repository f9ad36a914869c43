// The species of the world, with their build, their coats and their frequency in each dataset.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/world/coat.h"

namespace q3d::pipeline::world {

enum class Family : int { felidae, canidae, equidae, bovidae, hippopotamidae };
inline constexpr int kFamilies = 5;
std::string_view to_string(Family family);

// The relative changes of lengths by which a species differs from its family's centre: 0.1 is a tenth more.
struct Build {
  float legs = 0.0F;   // elbow and stifle to the ground
  float neck = 0.0F;   // withers to the head
  float girth = 0.0F;  // back to belly, side to side
  float head = 0.0F;   // eyes to nose
  float ears = 0.0F;
  float tail = 0.0F;
};

// The relative frequency in each dataset; 0 means that the species does not occur.
struct Frequency {
  double animal3d = 0.0, ctrlani3d = 0.0, superanimal = 0.0, animal_kingdom = 0.0;
};

struct Species {
  std::string_view name;  // lower case, spaces
  Family family;
  std::string_view synset;        // WordNet number, the first part of an ImageNet file name
  std::string_view kingdom_name;  // its name and its group in Animal Kingdom
  std::string_view kingdom_group;
  Frequency frequency;
  Build build;
  std::vector<Coat> coats;  // variants, equally frequent
};

std::span<const Species> species_table();

// Draws an individual's coat, which is one of the species' variants with its own shade.
Coat draw_coat(const Species& species, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
