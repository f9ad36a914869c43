#include "loaders/formats/coco_categories.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <stdexcept>

#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using nlohmann::json;

std::string text_in(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

std::vector<std::string> keypoint_names(const json& category) {
  std::vector<std::string> names;
  const auto list = category.find("keypoints");
  if (list == category.end() || !list->is_array()) return names;
  for (const json& name : *list) {
    names.push_back(name.is_string() ? name.get<std::string>() : manifests::describe(name));
  }
  return names;
}

bool has_keypoints(const json& annotation) {
  const auto found = annotation.find("keypoints");
  if (found == annotation.end() || !found->is_array()) return false;
  return std::any_of(found->begin(), found->end(),
                     [](const json& value) { return !value.is_number() || value.get<double>() != 0.0; });
}

keypoints::NameMatch match_in_order(const keypoints::Topology& topology) {
  keypoints::NameMatch match;
  match.places.resize(topology.keypoints.size());
  std::iota(match.places.begin(), match.places.end(), 0);
  return match;
}

// Returns whether the file lists the topology's keypoints in the topology's order.
bool are_in_order(const keypoints::NameMatch& match) {
  std::vector<int> present;
  std::copy_if(match.places.begin(), match.places.end(), std::back_inserter(present),
               [](int place) { return place >= 0; });
  return std::is_sorted(present.begin(), present.end());
}

}  // namespace

CocoCategories::CocoCategories(const json& document, const keypoints::Topology& topology, Loading& loading) {
  const auto categories = document.find("categories");
  if (categories != document.end() && categories->is_array()) {
    for (const json& category : *categories) {
      if (!category.is_object()) continue;
      CocoCategory read{.name = text_in(category, "name"),
                        .supercategory = text_in(category, "supercategory"),
                        .keypoints = keypoint_names(category)};
      const auto id = coco_id(category, "id");
      if (id && !place_of_id_.add(*id, list_.size())) {
        const CocoCategory& first = list_[*place_of_id_.find(*id)];
        if (first.name == read.name && first.keypoints == read.keypoints) continue;
        throw std::runtime_error(
            fmt::format("{}: categories: got the id {} for both \"{}\" and \"{}\", expected an id for each, "
                        "because an annotation's keypoints are read by it",
                        loading.file.string(), id->key(), first.name, read.name));
      }
      list_.push_back(std::move(read));
    }
  }
  choose(loading.options.categories, loading);
  match_keypoints(topology, loading);
}

void CocoCategories::choose(const std::vector<std::string>& names, const Loading& loading) {
  if (names.empty()) return;
  for (CocoCategory& category : list_) {
    category.is_chosen = std::find(names.begin(), names.end(), category.name) != names.end();
  }
  for (const std::string& name : names) {
    const bool is_there =
        std::any_of(list_.begin(), list_.end(), [&](const CocoCategory& each) { return each.name == name; });
    if (is_there) continue;
    std::vector<std::string> known;
    for (const CocoCategory& category : list_) known.push_back(category.name);
    throw std::invalid_argument(
        fmt::format("categories: got \"{}\", expected names of {}, which are {}", name, loading.file.string(),
                    known.empty() ? "(none)" : fmt::format("{}", fmt::join(known, ", "))));
  }
}

void CocoCategories::match_keypoints(const keypoints::Topology& topology, Loading& loading) {
  std::set<std::vector<std::string>> lists;
  std::set<std::string> notes;
  for (CocoCategory& category : list_) {
    if (!category.is_chosen || category.keypoints.empty()) continue;
    lists.insert(category.keypoints);
    try {
      category.match = keypoints::match_names(topology, category.keypoints);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(fmt::format(
          "{}: categories: \"{}\": keypoints: {}{}", loading.file.string(), category.name, error.what(),
          list_.size() > 1 ? ", or choose other categories with the key \"categories\" of the dataset" : ""));
    }
    if (const std::string note = category.match.note(topology); !note.empty()) {
      notes.insert(lists.size() > 1 ? fmt::format("category \"{}\": {}", category.name, note) : note);
    }
    has_common_ = lists.size() == 1;
    common_ = {.name = {}, .supercategory = {}, .keypoints = category.keypoints, .match = category.match};
  }
  for (const std::string& note : notes) {
    loading.notes.add(fmt::format("{}: {}", loading.file.filename().string(), note), NoteKind::caution);
  }
  lists_keypoints_ = !lists.empty();
  if (!lists_keypoints_) {
    loading.notes.add(fmt::format(
        "no category lists the names of its keypoints; they are read in the order of the topology {}",
        topology.name));
    has_common_ = true;
    common_ = {
        .name = {}, .supercategory = {}, .keypoints = topology.keypoints, .match = match_in_order(topology)};
    for (CocoCategory& category : list_) {
      category.keypoints = common_.keypoints;
      category.match = common_.match;
    }
  } else if (has_common_ && !are_in_order(common_.match)) {
    loading.notes.add(
        fmt::format("the file's keypoints are not in the order of the topology {}; they are matched by name",
                    topology.name));
  }
}

const CocoCategory* CocoCategories::of(const json& annotation) {
  const auto id = coco_id(annotation, "category_id");
  const std::size_t* place = id ? place_of_id_.find(*id) : nullptr;
  if (place != nullptr && !list_[*place].keypoints.empty()) return &list_[*place];
  if (!has_common_) return nullptr;
  if (place != nullptr) {
    // A category without keypoints of its own gets those that the other categories share.
    list_[*place].keypoints = common_.keypoints;
    list_[*place].match = common_.match;
    return &list_[*place];
  }
  return &common_;
}

bool CocoCategories::leaves_out(const json& annotation) {
  const auto id = coco_id(annotation, "category_id");
  const std::size_t* place = id ? place_of_id_.find(*id) : nullptr;
  if (place == nullptr) return false;
  const CocoCategory& category = list_[*place];
  if (!category.is_chosen) {
    ++left_out_by_choice_;
    return true;
  }
  if (!lists_keypoints_ || !category.keypoints.empty() || has_keypoints(annotation)) return false;
  ++left_out_without_keypoints_;
  return true;
}

void CocoCategories::add_notes(Loading& loading) const {
  if (left_out_by_choice_ > 0) {
    loading.notes.add(
        fmt::format("annotations of categories that are not chosen are left out: {}", left_out_by_choice_));
  }
  if (left_out_without_keypoints_ > 0) {
    loading.notes.add(
        fmt::format("annotations without keypoints, of categories that list none, are left out: {}",
                    left_out_without_keypoints_));
  }
  if (place_of_id_.found_as_other_type() > 0) {
    loading.notes.add(
        "category ids are texts in one place of the file and numbers in another; they are taken "
        "for the same if the numbers are equal",
        NoteKind::caution);
  }
}

}  // namespace q3d::loaders::formats
