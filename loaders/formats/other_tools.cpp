#include "loaders/formats/other_tools.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace q3d::loaders::formats {
namespace {

using nlohmann::json;

// The place in a document where the keys of a form are looked for.
enum class Place { document, first_of_list, first_value };

struct Form {
  Place place;
  std::vector<const char*> keys;  // all of them must be present
  const char* format;             // the format that reads it; empty if none does
  const char* meaning;
};

// Several formats read COCO's form.
constexpr std::array<std::string_view, 4> kCocoFormats{"coco", "superanimal", "animal_kingdom",
                                                       "photographs"};

const std::vector<Form>& forms() {
  static const std::vector<Form> kForms{
      {Place::document, {"images", "annotations"}, "coco", "COCO's form"},
      {Place::document, {"data"}, "prima", "records in the form of PRIMA and AniMer"},
      {Place::first_of_list, {"img_path", "joints"}, "stanfordextra", "StanfordExtra's list of dogs"},
      {Place::first_of_list, {"image_path", "joints", "visibility"}, "badja", "BADJA's list of frames"},
      {Place::first_of_list, {"image", "joints", "joints_vis"}, "animal_kingdom", "Animal Kingdom's list"},
      {Place::first_of_list,
       {"img_path", "keypoint_2d"},
       "",
       "a list of PRIMA's records, expected an object with this list under \"data\" and \"format\": "
       "\"prima\""},
      {Place::document,
       {"shapes", "imagePath"},
       "",
       "LabelMe's JSON of one picture, expected one COCO file for all: convert the folder to COCO keypoints"},
      {Place::document,
       {"_via_img_metadata"},
       "",
       "a project of the VGG Image Annotator, expected COCO: choose Annotation > Export Annotations (COCO "
       "format)"},
      {Place::first_value,
       {"filename", "regions"},
       "",
       "annotations of the VGG Image Annotator, expected COCO: choose Annotation > Export Annotations (COCO "
       "format)"},
      {Place::document,
       {"videos", "skeletons"},
       "",
       "SLEAP's JSON, expected its .slp (\"format\": \"sleap\"), or COCO, see docs/own-labels.md"},
      {Place::first_of_list,
       {"image_id", "keypoints", "score"},
       "",
       "COCO's results, a list that names no pictures, expected COCO's whole form: an object with "
       "\"images\", \"annotations\" (these results) and \"categories\""},
      {Place::first_of_list,
       {"data", "annotations"},
       "",
       "Label Studio's own JSON, expected COCO: export the project as COCO"},
      {Place::first_of_list,
       {"image", "annotator"},
       "",
       "Label Studio's JSON-MIN, expected COCO: export the project as COCO"},
      {Place::first_of_list,
       {"shapes", "imagePath"},
       "",
       "LabelMe's JSON, expected COCO: convert it to COCO keypoints"}};
  return kForms;
}

// Returns the object whose keys tell the form; null if there is none.
const json* holder_of(const json& document, Place place) {
  switch (place) {
    case Place::document:
      return document.is_object() ? &document : nullptr;
    case Place::first_of_list:
      return document.is_array() && !document.empty() && document[0].is_object() ? &document[0] : nullptr;
    case Place::first_value:
      return document.is_object() && !document.empty() && document.begin()->is_object() ? &*document.begin()
                                                                                        : nullptr;
  }
  return nullptr;
}

bool fits(const json& document, const Form& form) {
  const json* holder = holder_of(document, form.place);
  return holder != nullptr && std::all_of(form.keys.begin(), form.keys.end(),
                                          [&](const char* key) { return holder->contains(key); });
}

bool reads(const std::string& format, std::string_view form_of) {
  if (form_of == "coco") {
    return std::find(kCocoFormats.begin(), kCocoFormats.end(), format) != kCocoFormats.end();
  }
  return form_of == format;
}

}  // namespace

std::string known_tool(const json& document, const std::string& format) {
  const auto form =
      std::find_if(forms().begin(), forms().end(), [&](const Form& each) { return fits(document, each); });
  if (form == forms().end() || reads(format, form->format)) return {};
  const std::string_view reader = form->format;
  return reader.empty()
             ? std::string(form->meaning)
             : fmt::format("{}, which the format \"{}\" reads; the dataset says \"format\": \"{}\"",
                           form->meaning, reader, format);
}

void refuse_other_form(const json& document, const std::string& format, const std::filesystem::path& file) {
  if (const std::string tool = known_tool(document, format); !tool.empty()) {
    throw std::runtime_error(fmt::format("{}: got {}", file.string(), tool));
  }
}

}  // namespace q3d::loaders::formats
