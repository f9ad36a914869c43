#include "loaders/formats/other_tools.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <vector>

namespace q3d::loaders::formats {
namespace {

using nlohmann::json;

struct Form {
  bool is_list;                   // of objects with these keys, else one object
  std::vector<const char*> keys;  // all of them
  const char* meaning;
};

const std::vector<Form>& forms() {
  static const std::vector<Form> kForms{
      {false,
       {"shapes", "imagePath"},
       "LabelMe's JSON of one picture, expected one COCO file for all: convert the folder to COCO keypoints"},
      {false,
       {"_via_img_metadata"},
       "a project of the VGG Image Annotator, expected COCO: choose Annotation > Export Annotations (COCO "
       "format)"},
      {false,
       {"videos", "skeletons"},
       "SLEAP's JSON, expected COCO: export the project to COCO, see docs/own-labels.md"},
      {true,
       {"image_id", "keypoints", "score"},
       "COCO's results, a list that names no pictures, expected COCO's whole form: an object with "
       "\"images\", \"annotations\" (these results) and \"categories\""},
      {true, {"data", "annotations"}, "Label Studio's own JSON, expected COCO: export the project as COCO"},
      {true, {"shapes", "imagePath"}, "LabelMe's JSON, expected COCO: convert it to COCO keypoints"}};
  return kForms;
}

bool has_keys(const json& object, const std::vector<const char*>& keys) {
  return object.is_object() &&
         std::all_of(keys.begin(), keys.end(), [&](const char* key) { return object.contains(key); });
}

}  // namespace

std::string known_tool(const json& document) {
  if (document.is_object() && document.contains("images") && document.contains("annotations")) return {};
  for (const Form& form : forms()) {
    const bool fits = form.is_list
                          ? document.is_array() && !document.empty() && has_keys(document[0], form.keys)
                          : has_keys(document, form.keys);
    if (fits) return form.meaning;
  }
  return {};
}

}  // namespace q3d::loaders::formats
