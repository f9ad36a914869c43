#include "pipeline/derived/operations.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <unordered_set>

#include "pipeline/derived/where.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::derived {
namespace {

namespace fs = std::filesystem;
using dataset::PublishedDataset;
using dataset::VerdictRow;

std::string joined_names(const std::vector<Selection>& selections) {
  std::string joined;
  for (const Selection& selection : selections) {
    joined += (joined.empty() ? "" : "+") + selection.dataset.manifest().name;
  }
  return joined;
}

}  // namespace

MergeSummary merge(const std::vector<fs::path>& versions, const fs::path& out, const std::string& name,
                   const std::string& version) {
  if (versions.size() < 2) throw run::ConfigError("merge: got fewer than two versions, expected two or more");
  MergeSummary summary;
  std::vector<Selection> selections;
  std::unordered_set<std::string> ids;
  std::unordered_set<std::string> pictures;  // pictures of the earlier versions
  for (const fs::path& folder : versions) {
    Selection selection{PublishedDataset(folder), {}};
    std::vector<std::string> own_pictures;
    std::vector<VerdictRow> rows = selection.dataset.verdicts();
    for (VerdictRow& row : rows) {
      if (!ids.insert(row.id).second) {
        summary.repeated_ids.push_back(row.id);
        continue;
      }
      if (!row.image_sha256.empty()) {
        summary.same_pictures += pictures.contains(row.image_sha256) ? 1 : 0;
        own_pictures.push_back(row.image_sha256);
      }
      selection.rows.push_back(std::move(row));
    }
    pictures.insert(own_pictures.begin(), own_pictures.end());
    selections.push_back(std::move(selection));
  }
  const std::string merged_name = name.empty() ? joined_names(selections) : name;
  summary.version = write_derived(out, merged_name, version, std::move(selections),
                                  {{"operation", "merge"}, {"name", merged_name}, {"version", version}});
  return summary;
}

DerivedVersion subset(const fs::path& version_folder, const std::string& where, const fs::path& out,
                      const std::string& name, const std::string& version) {
  const Condition condition = parse_where(where);
  Selection selection{PublishedDataset(version_folder), {}};
  std::vector<VerdictRow> rows = selection.dataset.verdicts();
  for (VerdictRow& row : rows) {
    if (condition({row, selection.dataset.label_kind(row)})) selection.rows.push_back(std::move(row));
  }
  if (selection.rows.empty()) {
    throw run::ConfigError(
        fmt::format("--where \"{}\": none of the {} candidates of {} fulfils it, so there is nothing to "
                    "write; `quadruped3d "
                    "inspect {}` lists what they are",
                    where, rows.size(), selection.dataset.version_name(), version_folder.string()));
  }
  const std::string subset_name = name.empty() ? selection.dataset.manifest().name : name;
  std::vector<Selection> selections;
  selections.push_back(std::move(selection));
  return write_derived(
      out, subset_name, version, std::move(selections),
      {{"operation", "subset"}, {"where", where}, {"name", subset_name}, {"version", version}});
}

}  // namespace q3d::pipeline::derived
