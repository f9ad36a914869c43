// The collections that make up SuperAnimal-Quadruped. Each labels its own part of the 39 keypoints, and has
// its own conventions for names, boxes and missing points.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/random.h"
#include "pipeline/world/species.h"

namespace q3d::pipeline::world {

struct SuperAnimalSource {
  std::string_view name;         // of the collection, as in "source_dataset"
  std::vector<int> covers;       // which of the 39 it has; the others are -1, -1, -1
  bool missing_is_zero = false;  // a point of its own that is not labelled: 0, 0, 0 instead of -1, -1, -1
  int labelled_v = 2;
  bool keypoint_box = false;  // no box of its own: made from the keypoints, 20 px wider, cut at 0 only
};

std::span<const SuperAnimalSource> superanimal_sources();

// Draws the row of superanimal_sources() for another picture of a species.
int draw_source(const Species& species, manifests::Rng& rng);

// Returns the file's name as the collection and SuperAnimal's converter make it: "<stem>_<image id>.jpg". For
// some collections it includes the folder, or even the whole path, on the machine that converted it.
std::string source_file_name(int source, const Species& species, int image_id, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
