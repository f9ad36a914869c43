// A plan says which pictures a dataset gets: species, names and, where several belong together, their common
// origin.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/world/domain.h"

namespace q3d::pipeline::world {

struct PicturePlan {
  SetId set = SetId::animal3d;
  bool test = false;
  int index = 0;    // in its split
  int species = 0;  // row of species_table()
  int individual =
      0;            // pictures with the same number show the same animal in the same place (frames of a film)
  int source = -1;  // SuperAnimal: row of superanimal_sources()
  int image_id = 0;    // SuperAnimal: global number of the picture
  std::string image;   // path below the set's folder, unique
  std::string listed;  // how the annotation file names it
  std::string mask;    // path below the world's folder: hidden from the sets that have no masks
};

// Returns the pictures of one split in file order. `share` scales the counts; a count that is not zero stays
// at least 1.
std::vector<PicturePlan> plan_split(SetId set, bool test, double share, std::uint64_t seed);

// Distributes `total` things in proportion to the weights by largest remainders. The sum is exactly `total`.
std::vector<int> share_out(int total, const std::vector<double>& weights);

}  // namespace q3d::pipeline::world
