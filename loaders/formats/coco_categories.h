// The categories of a COCO file: the animals that they stand for, and the keypoints that they list.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "loaders/formats/coco_ids.h"
#include "loaders/formats/formats.h"
#include "loaders/keypoints/name_match.h"

namespace q3d::loaders::formats {

struct CocoCategory {
  std::string name;                      // "" if the file gives none
  std::string supercategory;             // likewise
  std::vector<std::string> keypoints{};  // empty if it lists none
  keypoints::NameMatch match{};          // of its keypoints with the topology
  bool is_chosen = true;
};

class CocoCategories {
 public:
  // Reads `categories` and matches the keypoints of those that the dataset's options choose. Missing and
  // unknown keypoints are noted. Throws std::invalid_argument if the options choose a category that the file
  // lacks, and std::runtime_error if the keypoints of a chosen category are not those of the topology.
  CocoCategories(const nlohmann::json& document, const keypoints::Topology& topology, Loading& loading);

  // Returns the annotation's category. If it states none that the file has, returns the only list of
  // keypoints of the file, or null if there are several.
  const CocoCategory* of(const nlohmann::json& annotation);

  // Returns whether the annotation is left out. That is so if its category is not chosen. It is also so for a
  // rectangle or an outline without keypoints whose category lists none while other categories do; Label
  // Studio and CVAT write these.
  bool leaves_out(const nlohmann::json& annotation);

  // Notes how many annotations were left out.
  void add_notes(Loading& loading) const;

 private:
  void choose(const std::vector<std::string>& names, const Loading& loading);
  void match_keypoints(const keypoints::Topology& topology, Loading& loading);

  std::vector<CocoCategory> list_;
  CocoIdMap<std::size_t> place_of_id_;
  CocoCategory common_;           // for annotations without a category
  bool has_common_ = false;       // whether all categories list the same keypoints
  bool lists_keypoints_ = false;  // whether any category lists keypoints
  std::size_t left_out_by_choice_ = 0;
  std::size_t left_out_without_keypoints_ = 0;
};

}  // namespace q3d::loaders::formats
