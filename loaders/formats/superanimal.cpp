// Loads SuperAnimal-Quadruped80K: COCO with 39 keypoints and pictures of eight sub-datasets.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "loaders/formats/coco.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::SampleRecord;

// These sub-datasets put "neck" at the shoulder end; SuperAnimal stores it as neck_base, which is the head
// end (and the neck of the 26). Such a point would teach the wrong place, so its weight is 0; v is unchanged.
constexpr std::array<std::string_view, 4> kNeckAtTheShoulders{"ap10k", "apt36k", "cheetah", "acinoset"};
constexpr std::size_t kNeck = 18;  // index among Animal3D's 26

bool has_neck_at_the_shoulders(std::string_view source) {
  return std::find(kNeckAtTheShoulders.begin(), kNeckAtTheShoulders.end(),
                   species::normalised_source(source)) != kNeckAtTheShoulders.end();
}

void add_species(Loading& loading, RecordReader&, const CocoCategory&, SampleRecord& sample) {
  if (has_neck_at_the_shoulders(sample.source) && sample.keypoints[kNeck].weight > 0.0F) {
    sample.keypoints[kNeck].weight = 0.0F;
    loading.notes.count(
        fmt::format("source {} labels the neck at the shoulders, so this keypoint gets weight 0",
                    sample.source),
        sample.id);
  }
  sample.species = species::species_of_picture(sample.image_ref, sample.source);
  set_family(loading, std::nullopt, species::family_of_species(sample.species), sample);
}

}  // namespace

Dataset load_superanimal(const DatasetOptions& options) {
  Loading loading(options, "images");
  const nlohmann::json document = manifests::read_json_file(loading.file);
  return load_coco(document, keypoints::topology("superanimal_quadruped39"), loading, {.add = add_species});
}

}  // namespace q3d::loaders::formats
