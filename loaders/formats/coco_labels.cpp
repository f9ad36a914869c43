// Loads COCO keypoints of any animals with a topology file: AP-10K, AnimalPose, a lab's own labels or the
// output of a pose estimator.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "loaders/formats/coco.h"
#include "loaders/keypoints/confidence.h"
#include "loaders/keypoints/topology_file.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Family;
using manifests::Keypoint;
using manifests::Reason;
using manifests::SampleRecord;

// Words that tools write instead of a species if the user gave none.
constexpr std::array<std::string_view, 10> kNoSpecies{"default",  "object",   "objects",  "animal",
                                                      "animals",  "instance", "keypoint", "keypoints",
                                                      "skeleton", "pose"};

// AP-10K's supercategories are zoological families; other files have words such as "animal" there.
std::optional<Family> family_of_supercategory(const std::string& supercategory) {
  const std::string name = species::normalised_species(supercategory);
  if (!name.ends_with("idae")) return std::nullopt;
  for (const Family family :
       {Family::felidae, Family::canidae, Family::equidae, Family::bovidae, Family::hippopotamidae}) {
    if (name == manifests::to_string(family)) return family;
  }
  return Family::none;
}

// Returns the rule that leaves the animal of this name out, or "".
std::string left_out_as(const std::string& name) {
  return species::not_a_quadruped({.parent_class = {}, .animal_class = {}, .subclass = {}, .animal = name});
}

// The species is the one that the user gives. Without one, it is the category's name if that is an animal's,
// else the species that the picture's name tells, else the category's name unchanged.
std::string species_of(const CocoCategory& category, const Loading& loading, const SampleRecord& sample) {
  if (!loading.options.species.empty()) return species::normalised_species(loading.options.species);
  const std::string named = species::normalised_species(category.name);
  if (species::family_of_species(named) || !left_out_as(named).empty()) return named;
  const std::string pictured = species::species_of_picture(sample.image_ref, sample.source);
  if (!pictured.empty()) return pictured;
  return std::find(kNoSpecies.begin(), kNoSpecies.end(), named) == kNoSpecies.end() ? named : std::string();
}

void add_animal(Loading& loading, RecordReader& annotation, const CocoCategory& category,
                SampleRecord& sample) {
  sample.species = species_of(category, loading, sample);
  if (const std::string rule = left_out_as(sample.species); !rule.empty()) {
    annotation.fail(Reason::not_a_quadruped, "category_id", rule, "a four-legged mammal");
    return;
  }
  set_family(loading, family_of_supercategory(category.supercategory),
             species::family_of_species(sample.species), sample);
}

}  // namespace

Dataset load_coco_labels(const DatasetOptions& options) {
  Loading loading(options, "images");
  const keypoints::Topology topology = keypoints::read_topology_file(options.topology);
  loading.more_files.push_back(options.topology);
  const nlohmann::json document = manifests::read_json_file(loading.file);
  keypoints::ConfidenceWeights weights(options.min_confidence);
  const CocoRules rules{.add = add_animal,
                        .weigh = [&](std::span<Keypoint> keypoints) { weights.apply(keypoints); },
                        .box_margin = options.box_margin};
  Dataset dataset = load_coco(document, topology, loading, rules);
  if (const std::string note = weights.note(); !note.empty())
    dataset.notes.push_back({NoteKind::remark, note});
  return dataset;
}

}  // namespace q3d::loaders::formats
