// COCO keypoints of any animals, by a topology file: AP-10K, AnimalPose, a lab's own labels or the output of
// a pose estimator.
#include <fmt/format.h>

#include <map>
#include <stdexcept>

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

struct Category {
  std::string name;
  std::string supercategory;
};

std::map<std::int64_t, Category> categories_of(const nlohmann::json& document) {
  std::map<std::int64_t, Category> categories;
  const auto list = document.find("categories");
  if (list == document.end() || !list->is_array()) return categories;
  const auto text = [](const nlohmann::json& object, const char* key) {
    return object.contains(key) && object[key].is_string() ? object[key].get<std::string>() : std::string();
  };
  for (const nlohmann::json& category : *list) {
    if (!category.is_object() || !category.contains("id") || !category["id"].is_number_integer()) continue;
    categories[category["id"].get<std::int64_t>()] = {text(category, "name"),
                                                      text(category, "supercategory")};
  }
  return categories;
}

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
// else what the picture's name tells, else the category's name as it stands.
std::string species_of(const Category& category, const Loading& loading, const SampleRecord& sample) {
  if (!loading.options.species.empty()) return species::normalised_species(loading.options.species);
  const std::string named = species::normalised_species(category.name);
  if (species::family_of_species(named) || !left_out_as(named).empty()) return named;
  const std::string pictured = species::species_of_picture(sample.image_ref, sample.source);
  return pictured.empty() ? named : pictured;
}

void add_animal(const std::map<std::int64_t, Category>& categories, Loading& loading,
                RecordReader& annotation, SampleRecord& sample) {
  const auto id = annotation.integer("category_id");
  const auto found = id ? categories.find(*id) : categories.end();
  const Category category = found == categories.end() ? Category{} : found->second;
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
  const auto categories = categories_of(document);
  keypoints::ConfidenceWeights weights(options.min_confidence);
  const CocoRules rules{
      .add = [&](Loading& here, RecordReader& annotation,
                 SampleRecord& sample) { add_animal(categories, here, annotation, sample); },
      .weigh = [&](std::span<Keypoint> keypoints) { weights.apply(keypoints); },
      .box_margin = options.box_margin};
  Dataset dataset = load_coco(document, topology, loading, rules);
  if (const std::string note = weights.note(); !note.empty()) dataset.notes.push_back(note);
  return dataset;
}

}  // namespace q3d::loaders::formats
