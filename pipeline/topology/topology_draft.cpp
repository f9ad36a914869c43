#include "pipeline/topology/topology_draft.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#include "loaders/formats/dataset.h"
#include "loaders/keypoints/topology_file.h"
#include "manifests/atomic_file.h"
#include "pipeline/report/label_sheet.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::topology {
namespace {

namespace fs = std::filesystem;
using manifests::SampleRecord;

// Returns the folder that holds the labels.
fs::path folder_of(const fs::path& labels) {
  const fs::path absolute = fs::absolute(labels).lexically_normal();
  return fs::is_directory(absolute) ? absolute : absolute.parent_path();
}

std::vector<SampleRecord> spread(const std::vector<SampleRecord>& records, int count) {
  std::vector<const SampleRecord*> usable;
  for (const SampleRecord& record : records) {
    if (record.failure == manifests::Reason::none) usable.push_back(&record);
  }
  const std::size_t wanted = std::min(static_cast<std::size_t>(count), usable.size());
  std::vector<SampleRecord> chosen;
  for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(*usable[i * usable.size() / wanted]);
  return chosen;
}

bool is_picture(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending == ".jpg" || ending == ".jpeg" || ending == ".png";
}

// Returns the folder at or below the labels' folder that holds the most pictures itself, relative to the
// latter; empty if that is the labels' folder.
fs::path folder_of_most_pictures(const fs::path& labels) {
  const fs::path top = folder_of(labels);
  std::map<fs::path, std::size_t> counts;
  std::error_code error;
  const auto options = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(top, options, error), end; !error && it != end;
       it.increment(error)) {
    if (is_picture(it->path())) ++counts[it->path().parent_path().lexically_relative(top)];
  }
  const auto most = std::max_element(counts.begin(), counts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == counts.end() || most->first == "." ? fs::path() : most->first;
}

}  // namespace

Draft draft_topology(const DraftOptions& options) {
  if (!options.out.empty() && fs::exists(options.out) && !options.replaces) {
    throw run::ConfigError(
        fmt::format("{}: there is such a file already, and it may hold corrections; give --force to write "
                    "over it, or another --out",
                    options.out.string()));
  }
  Draft draft{loaders::formats::survey_labels(options.from), {}, {}};
  // The labels of a DeepLabCut project name the places of its pictures.
  if (!fs::is_directory(options.from)) draft.images = folder_of_most_pictures(options.from);
  const std::string name = options.name.empty() ? draft.survey.file.stem().string() : options.name;
  draft.guess = loaders::keypoints::guess_topology(name, draft.survey.names);
  const std::string about = fmt::format(
      "Guessed by `quadruped3d topology` from the names in {}. {} of the 26 have a source. Say here "
      "what you checked.",
      draft.survey.file.filename().string(),
      std::count_if(draft.guess.topology.source.begin(), draft.guess.topology.source.end(),
                    [](int source) { return source >= 0; }));
  draft.text = loaders::keypoints::topology_json(draft.guess.topology, about).dump(2) + "\n";
  if (!options.out.empty()) manifests::write_file_atomically(options.out, draft.text);
  return draft;
}

std::vector<loaders::formats::Note> draw_label_sheet(const SheetOptions& options) {
  const loaders::formats::LabelSurvey survey = loaders::formats::survey_labels(options.labels);
  if (survey.format.empty()) {
    throw run::ConfigError(
        fmt::format("{}: no sheet can be drawn of {}'s files, because no format loads them",
                    options.labels.string(), survey.kind));
  }
  loaders::formats::DatasetOptions dataset;
  dataset.name = "sheet";
  dataset.format = survey.format;
  dataset.root = options.root.empty() ? folder_of(options.labels) : fs::absolute(options.root);
  dataset.annotations = fs::absolute(options.labels);
  dataset.images = options.images;
  dataset.topology = options.topology;
  const loaders::formats::Dataset loaded = loaders::formats::load_dataset(dataset);
  const std::vector<SampleRecord> chosen = spread(loaded.records, options.count);
  if (chosen.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: no animal can be drawn{}{}. --images names the folder of the pictures, and --root the "
        "folder that their names count from",
        options.labels.string(), loaded.records.empty() ? ", because there is none" : "; the first one: ",
        loaded.records.empty() ? std::string() : loaded.records.front().failure_detail));
  }
  report::write_label_sheet(options.sheet, chosen, loaders::keypoints::read_topology_file(options.topology));
  return loaded.notes;
}

}  // namespace q3d::pipeline::topology
