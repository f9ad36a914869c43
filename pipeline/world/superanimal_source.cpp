#include "pipeline/world/superanimal_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>

namespace q3d::pipeline::world {
namespace {

enum Row { awa = 0, ap10k, animalpose, stanford_dogs, cheetah, horse };

// These give SuperAnimal's indices by collection, from DeepLabCut's conversion table.
std::vector<int> all_but_antlers() {
  std::vector<int> points;
  for (int i = 0; i < 39; ++i) {
    if (i != 8 && i != 9 && i != 13 && i != 14) points.push_back(i);
  }
  return points;
}

std::string with_plus(std::string_view name) {
  std::string result(name);
  std::replace(result.begin(), result.end(), ' ', '+');
  return result;
}

bool is_one_of(std::string_view name, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

std::span<const SuperAnimalSource> superanimal_sources() {
  static const std::vector<SuperAnimalSource> kSources{
      {.name = "AwA-Pose", .covers = all_but_antlers()},
      {.name = "AP-10K",
       .covers = {0, 5, 10, 15, 22, 24, 26, 27, 29, 30, 31, 32, 33, 34, 35},
       .missing_is_zero = true},
      {.name = "animalpose",
       .covers = {0, 5, 6, 10, 11, 17, 19, 22, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35},
       .missing_is_zero = true,
       .labelled_v = 1},
      {.name = "stanforddogs",
       .covers = {0, 5, 6, 7, 10, 11, 12, 17, 19, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35},
       .missing_is_zero = true,
       .labelled_v = 1},
      {.name = "cheetah",
       .covers = {0, 5, 10, 15, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35},
       .keypoint_box = true},
      {.name = "horse-10", .covers = {0, 5, 19, 26, 27, 29, 30, 32, 35}, .keypoint_box = true},
  };
  return kSources;
}

int draw_source(const Species& species, manifests::Rng& rng) {
  std::array<double, 6> weights{75, 25, 0, 0, 0, 0};
  if (species.name == "labrador") {  // AwA has no folder for it
    weights = {0, 20, 20, 60, 0, 0};
  } else if (is_one_of(species.name, {"german shepherd", "dalmatian", "collie", "chihuahua"})) {
    weights = {50, 10, 5, 35, 0, 0};
  } else if (is_one_of(species.name, {"siamese cat", "persian cat", "cow", "sheep"})) {
    weights = {65, 12, 23, 0, 0, 0};
  } else if (species.name == "horse") {
    weights = {40, 10, 15, 0, 0, 35};
  } else if (species.name == "cheetah") {
    weights = {0, 40, 0, 0, 60, 0};
  }
  double left = rng.uniform() * std::accumulate(weights.begin(), weights.end(), 0.0);
  for (int row = 0; row < static_cast<int>(weights.size()); ++row) {
    left -= weights[static_cast<std::size_t>(row)];
    if (left < 0.0) return row;
  }
  return awa;
}

std::string source_file_name(int source, const Species& species, int image_id, manifests::Rng& rng) {
  switch (source) {
    case awa:
      return fmt::format("{}_{}_{}.jpg", with_plus(species.name), 10000 + rng.below(1900), image_id);
    case ap10k:
      return fmt::format("{:012d}_{}.jpg", 40000 + image_id, image_id);
    case animalpose:
      return fmt::format("2{:03d}_{:06d}_{}.jpg", 7 + rng.below(5), image_id, image_id);
    case stanford_dogs:
      return fmt::format("{}_{}_{}.jpg", species.synset, 60000 + image_id, image_id);
    case cheetah:
      return fmt::format("images/run{}_f{:05d}_{}.jpg", 1 + rng.below(9), rng.below(400), image_id);
    case horse:
      return fmt::format("/data/quadruped80k/images/Sample{}_{:04d}_{}.jpg", 1 + rng.below(30),
                         rng.below(250), image_id);
    default:
      throw std::invalid_argument("source_file_name: no source " + std::to_string(source));
  }
}

}  // namespace q3d::pipeline::world
