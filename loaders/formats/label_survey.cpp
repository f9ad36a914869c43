#include "loaders/formats/label_survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string_view>

#include "loaders/formats/label_table.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::string_view kNoAnimal = "single";  // DeepLabCut's individual for points of no animal

void add_once(const std::string& name, std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

const json& list_in(const json& object, const char* key) {
  static const json kNone = json::array();
  const bool is_list = object.is_object() && object.contains(key) && object[key].is_array();
  return is_list ? object[key] : kNone;
}

LabelSurvey survey_coco(const json& document, const fs::path& file) {
  LabelSurvey survey{file, "COCO", "coco", {}, {}};
  std::size_t lists = 0;
  for (const json& category : list_in(document, "categories")) {
    const std::size_t before = survey.names.size();
    for (const json& name : list_in(category, "keypoints")) {
      if (name.is_string()) add_once(name.get<std::string>(), survey.names);
    }
    if (list_in(category, "keypoints").empty()) continue;
    if (++lists > 1 && survey.names.size() != before) {
      survey.notes.emplace_back(
          "the categories list different keypoints; the names of all of them are taken");
    }
  }
  if (survey.names.empty()) {
    throw std::runtime_error(
        fmt::format("{}: categories: got none that lists the names of its keypoints, expected a list "
                    "\"keypoints\". Add it to the file, or write the topology by hand (docs/own-labels.md)",
                    file.string()));
  }
  return survey;
}

// LabelMe writes a file for each picture. Points are shapes of this type, and their labels are the names.
void survey_labelme(const json& document, LabelSurvey& survey) {
  for (const json& shape : list_in(document, "shapes")) {
    const bool is_point = shape.is_object() && shape.value("shape_type", json()) == "point" &&
                          shape.contains("label") && shape["label"].is_string();
    if (is_point) add_once(shape["label"].get<std::string>(), survey.names);
  }
}

LabelSurvey survey_labelme_files(const std::vector<fs::path>& files) {
  LabelSurvey survey{files.front(), "LabelMe", "", {}, {}};
  survey.notes.emplace_back(
      "LabelMe's files do not load as they are: convert them to COCO, with the same names, and use the "
      "format \"coco\"");
  for (const fs::path& file : files) survey_labelme(manifests::read_json_file(file), survey);
  if (survey.names.empty()) {
    throw std::runtime_error(
        fmt::format("{}: shapes: got no point, expected LabelMe's points, whose labels are "
                    "the names of the keypoints",
                    files.front().string()));
  }
  return survey;
}

bool has_all(const json& document, std::initializer_list<const char*> keys) {
  return document.is_object() &&
         std::all_of(keys.begin(), keys.end(), [&](const char* key) { return document.contains(key); });
}

[[noreturn]] void refuse_known(const fs::path& file, const char* what, const char* format) {
  throw std::runtime_error(
      fmt::format("{}: these are {}, whose keypoints are known: use \"format\": \"{}\", without a topology",
                  file.string(), what, format));
}

LabelSurvey survey_json(const fs::path& file) {
  const json document = manifests::read_json_file(file);
  if (has_all(document, {"categories"})) return survey_coco(document, file);
  if (has_all(document, {"shapes"})) return survey_labelme_files({file});
  if (has_all(document, {"data"})) refuse_known(file, "records in the form of PRIMA and AniMer", "prima");
  const json first = document.is_array() && !document.empty() ? document.front() : json();
  if (has_all(first, {"img_path", "joints"})) refuse_known(file, "StanfordExtra's records", "stanfordextra");
  if (has_all(first, {"image_path", "joints", "visibility"})) refuse_known(file, "BADJA's records", "badja");
  if (has_all(first, {"joints_vis"})) refuse_known(file, "Animal Kingdom's records", "animal_kingdom");
  throw std::runtime_error(
      fmt::format("{}: top level: got {}, expected COCO (with \"categories\") or LabelMe (with \"shapes\")",
                  file.string(), manifests::describe(document)));
}

LabelSurvey survey_table(const fs::path& file) {
  const LabelTable table = read_label_table(file);
  LabelSurvey survey{file, "a table of DeepLabCut's kind", "deeplabcut", {}, {}};
  const bool is_sleap = !table.columns.empty() && table.columns.front().scorer == "SLEAP";
  if (is_sleap) survey.kind = "SLEAP";
  if (is_sleap) survey.format = "sleap";
  std::set<std::string> individuals;
  for (const LabelColumn& column : table.columns) individuals.insert(column.individual);
  for (const LabelColumn& column : table.columns) {
    const bool is_of_no_animal = column.individual == kNoAnimal && individuals.size() > 1;
    if (!is_of_no_animal) add_once(column.bodypart, survey.names);
  }
  if (survey.names.empty()) {
    throw std::runtime_error(
        fmt::format("{}: got a table without keypoints, expected at least one", file.string()));
  }
  return survey;
}

LabelSurvey survey_folder(const fs::path& folder) {
  std::set<fs::path> tables;
  std::set<fs::path> documents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    const fs::path extension = entry.path().extension();
    const bool is_labels = entry.path().filename().string().starts_with("CollectedData");
    if (is_labels && (extension == ".h5" || extension == ".csv")) tables.insert(entry.path());
    const bool is_beside_pictures = extension == ".json" && entry.path().parent_path() == folder;
    if (is_beside_pictures && has_all(manifests::read_json_file(entry.path()), {"shapes"})) {
      documents.insert(entry.path());
    }
  }
  if (!tables.empty()) return survey_table(*tables.begin());
  if (!documents.empty()) return survey_labelme_files({documents.begin(), documents.end()});
  throw std::runtime_error(
      fmt::format("{}: got a folder without labels, expected DeepLabCut's CollectedData files in or below "
                  "it, or LabelMe's .json files in it",
                  folder.string()));
}

}  // namespace

LabelSurvey survey_labels(const fs::path& file_or_folder) {
  if (fs::is_directory(file_or_folder)) return survey_folder(file_or_folder);
  return file_or_folder.extension() == ".json" ? survey_json(file_or_folder) : survey_table(file_or_folder);
}

}  // namespace q3d::loaders::formats
