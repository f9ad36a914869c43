#include "pipeline/exports/croissant.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace q3d::pipeline::exports {
namespace {

using nlohmann::ordered_json;

constexpr const char* kPaper =
    "Xiaohang Yu, Ti Wang and Mackenzie Weygandt Mathis: PRIMA: Boosting Animal Mesh Recovery with "
    "Biological Priors and Test-Time Adaptation. arXiv:2606.02366, 2026.";

// Returns the @context of the specification.
ordered_json context() {
  ordered_json context = {{"@language", "en"}, {"@vocab", "https://schema.org/"}};
  for (const char* term : {"arrayShape", "citeAs",   "column",      "containedIn",   "equivalentProperty",
                           "extract",    "field",    "fileObject",  "fileSet",       "fileProperty",
                           "format",     "includes", "isArray",     "isLiveDataset", "jsonPath",
                           "key",        "md5",      "parentField", "path",          "recordSet",
                           "references", "regex",    "repeated",    "replace",       "samplingRate",
                           "separator",  "source",   "subField",    "transform"}) {
    context[term] = fmt::format("cr:{}", term);
  }
  context["conformsTo"] = "dct:conformsTo";
  context["cr"] = "http://mlcommons.org/croissant/";
  context["dct"] = "http://purl.org/dc/terms/";
  context["rai"] = "http://mlcommons.org/croissant/RAI/";
  context["sc"] = "https://schema.org/";
  context["data"] = {{"@id", "cr:data"}, {"@type", "@json"}};
  context["dataType"] = {{"@id", "cr:dataType"}, {"@type", "@vocab"}};
  context["description"] = {{"@container", "@language"}};
  context["examples"] = {{"@id", "cr:examples"}, {"@type", "@json"}};
  context["name"] = {{"@container", "@language"}};
  return context;
}

ordered_json file_object(const CroissantRecords& records) {
  return {{"@type", "cr:FileObject"},
          {"@id", records.file},
          {"name", records.file},
          {"contentUrl", records.file},
          {"contentSize", fmt::format("{} B", records.bytes)},
          {"encodingFormat", "application/json"},
          {"sha256", records.sha256}};
}

ordered_json picture_set(const std::string& pattern, std::size_t number) {
  const std::string id = fmt::format("pictures-{}", number);
  return {{"@type", "cr:FileSet"},
          {"@id", id},
          {"name", id},
          {"description", "Pictures and masks."},
          {"encodingFormat", pattern.ends_with("png") ? "image/png" : "image/jpeg"},
          {"includes", pattern}};
}

ordered_json record_set(const CroissantRecords& records) {
  ordered_json fields = ordered_json::array();
  for (const CroissantField& field : records.fields) {
    ordered_json entry = {{"@type", "cr:Field"},
                          {"@id", records.name + "/" + field.name},
                          {"name", field.name},
                          {"description", field.meaning},
                          {"dataType", field.type},
                          {"source",
                           {{"fileObject", {{"@id", records.file}}},
                            {"extract", {{"jsonPath", records.records_path + "." + field.json_path}}}}}};
    if (!field.shape.empty()) {
      entry["isArray"] = true;
      entry["arrayShape"] = field.shape;
    }
    fields.push_back(std::move(entry));
  }
  return {{"@type", "cr:RecordSet"}, {"@id", records.name}, {"name", records.name}, {"field", fields}};
}

}  // namespace

std::string croissant_text(const CroissantDataset& dataset) {
  ordered_json distribution = ordered_json::array();
  ordered_json record_sets = ordered_json::array();
  for (const CroissantRecords& records : dataset.records) {
    distribution.push_back(file_object(records));
    record_sets.push_back(record_set(records));
  }
  for (std::size_t i = 0; i < dataset.picture_patterns.size(); ++i) {
    distribution.push_back(picture_set(dataset.picture_patterns[i], i));
  }
  std::string citation = kPaper;
  for (const std::string& each : dataset.citations) citation += "\n\n" + each;
  ordered_json document = {
      {"@context", context()},
      {"@type", "sc:Dataset"},
      {"conformsTo", "http://mlcommons.org/croissant/1.1"},
      {"name", dataset.name},
      {"description", dataset.description},
      {"version", dataset.version},
      {"license", dataset.licences},
      {"citeAs", citation},
      {"rai:dataLimitations",
       "Labels of the kinds retained and refined are pseudo labels: a network predicted them, and a rule on "
       "the reprojection error of 2D keypoints decided which to keep. A small 2D error does not prove a "
       "right 3D pose."},
      {"distribution", distribution},
      {"recordSet", record_sets}};
  if (!dataset.sources.empty()) document["isBasedOn"] = dataset.sources;
  return document.dump(2) + "\n";
}

}  // namespace q3d::pipeline::exports
