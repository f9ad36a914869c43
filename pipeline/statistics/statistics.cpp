#include "pipeline/statistics/statistics.h"

#include "pipeline/statistics/accuracy.h"
#include "pipeline/statistics/distributions.h"
#include "pipeline/statistics/explorer.h"
#include "pipeline/statistics/groups.h"
#include "pipeline/statistics/shape_space.h"

namespace q3d::pipeline::statistics {
namespace {

using nlohmann::ordered_json;

// Adds the texts for people that dataset.json itself holds. Older datasets lack them.
void add_said(const ordered_json& document, const char* key, ordered_json& list) {
  if (!document.contains(key) || !document[key].is_array()) return;
  for (const ordered_json& line : document[key]) list.push_back(line);
}

ordered_json notes(const ordered_json& document, const Facts& facts) {
  ordered_json list = ordered_json::array();
  add_said(document, "notes", list);
  for (const std::string& line : facts.missing) list.push_back(line);
  return list;
}

ordered_json warnings(const ordered_json& document) {
  ordered_json list = ordered_json::array();
  add_said(document, "warnings", list);
  return list;
}

}  // namespace

ordered_json statistics(const dataset::PublishedDataset& dataset, const Facts& facts) {
  const ordered_json document = dataset::read_dataset_document(dataset.folder());
  const dataset::DatasetManifest& manifest = dataset.manifest();
  return {{"format", kStatisticsFormat},
          {"schema", kStatisticsSchema},
          {"dataset",
           {{"folder", dataset.version_name()},
            {"name", manifest.name},
            {"version", manifest.version},
            {"key", manifest.key},
            {"content_id", manifest.content_id},
            {"toolkit", manifest.toolkit},
            {"profile", manifest.profile},
            {"shards", manifest.shards.size()}}},
          {"counts", document.at("counts")},
          {"labels", document.at("labels")},
          {"warnings", warnings(document)},
          {"notes", notes(document, facts)},
          {"funnel", funnel(facts)},
          {"reasons", reasons(facts)},
          {"groups", groups(facts)},
          {"errors", error_histogram(facts, manifest)},
          {"adaptation", adaptation(facts)},
          {"accuracy", accuracy(facts)},
          {"keypoints", keypoint_table(facts)},
          {"visible", visible_keypoints(facts)},
          {"sizes", sizes(facts)},
          {"trust", trust_histogram(facts)},
          {"shape", shape_space(facts)},
          {"explorer", explorer(facts, manifest, document)},
          {"thresholds", document.at("thresholds")},
          {"provenance", document.at("provenance")}};
}

}  // namespace q3d::pipeline::statistics
