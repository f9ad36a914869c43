// The synthetic world: rendered quadrupeds with known truth, written in the native layouts of the four
// datasets.
//
//   OUT/world.json                                        options and counts; written last
//   OUT/animal3d/{train,test}.json, images/, masks/       with 3D truth
//   OUT/control_animal3dlatest/...                        likewise, cleaner
//   OUT/superanimal_quadruped/annotations/{train,test}.json, images/
//   OUT/animal_kingdom/annotation/ak_P3_mammal/test.json, dataset/<VIDEO>/
//   OUT/truth/*.json, masks/                              what is true of the 2D-only sets, for evaluation
//   alone OUT/assets/smal_synthetic.safetensors                 the body model
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

namespace q3d::pipeline::world {

struct WorldOptions {
  std::filesystem::path out;
  std::uint64_t seed = 0;
  int picture_px = 320;         // longer side of a photograph; Animal Kingdom's frames are twice as wide
  double share = 1.0;           // of the default number of pictures, 5,000
  int threads = 0;              // 0 = one for each core; never changes a byte
  std::filesystem::path asset;  // file for the body model; empty = below out
  std::function<void(int done, int total)> progress;  // called from the calling thread
};

struct WorldSummary {
  std::map<std::string, int> pictures;  // "animal3d/train" -> count
  int total = 0;
  bool reused = false;  // the folder already held this very world
  std::filesystem::path asset;
};

// Renders the world into options.out. A folder that holds a finished world of the same options is left
// unchanged; an unfinished world of a killed run is made anew. Throws std::invalid_argument for options out
// of range and std::runtime_error if the folder holds anything else, is in use or cannot be written.
WorldSummary make_world(const WorldOptions& options);

}  // namespace q3d::pipeline::world
