// DeepLabCut's own files: labels made by hand (CollectedData_*) and predictions with likelihoods, as .h5 or
// .csv, of one animal or several.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "loaders/formats/formats.h"
#include "loaders/formats/label_table.h"
#include "loaders/keypoints/confidence.h"
#include "loaders/keypoints/topology_file.h"
#include "loaders/pictures/box.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using manifests::Keypoint;
using manifests::Reason;
using manifests::SampleRecord;

// DeepLabCut files keypoints that belong to no animal under this individual.
constexpr std::string_view kNoAnimal = "single";

struct PointColumns {
  std::size_t x = 0;
  std::size_t y = 0;
  std::optional<std::size_t> likelihood;
};

struct Individual {
  std::string name;                  // empty where the table has one animal
  std::vector<PointColumns> points;  // in the topology's order
};

// The columns of one individual's keypoints by name, in the order of the file.
struct FoundColumns {
  std::vector<std::string> bodyparts;
  std::map<std::string, std::map<std::string, std::size_t>> of_bodypart;  // coordinate -> column
};

std::vector<PointColumns> in_order(const FoundColumns& found, const keypoints::Topology& topology,
                                   const std::string& where) {
  std::vector<int> order;
  try {
    order = keypoints::order_in_file(topology, found.bodyparts);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("{}: bodyparts: {}", where, error.what()));
  }
  std::vector<PointColumns> points;
  for (const int place : order) {
    const std::string& bodypart = found.bodyparts[static_cast<std::size_t>(place)];
    const auto& columns = found.of_bodypart.at(bodypart);
    const auto x = columns.find("x");
    const auto y = columns.find("y");
    const auto likelihood = columns.find("likelihood");
    if (x == columns.end() || y == columns.end()) {
      throw std::runtime_error(fmt::format("{}: {}: expected a column x and a column y", where, bodypart));
    }
    points.push_back({x->second, y->second, {}});
    if (likelihood != columns.end()) points.back().likelihood = likelihood->second;
  }
  return points;
}

std::vector<Individual> individuals_of(const LabelTable& table, const keypoints::Topology& topology,
                                       const fs::path& file, Notes& notes) {
  std::vector<std::string> names;  // in the file's order
  std::map<std::string, FoundColumns> found;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const LabelColumn& column = table.columns[i];
    if (column.scorer != table.columns[0].scorer) {
      throw std::runtime_error(
          fmt::format("{}: scorer: got both \"{}\" and \"{}\", expected one scorer in a file", file.string(),
                      table.columns[0].scorer, column.scorer));
    }
    if (found.count(column.individual) == 0) names.push_back(column.individual);
    FoundColumns& here = found[column.individual];
    auto& coordinates = here.of_bodypart[column.bodypart];
    if (coordinates.empty()) here.bodyparts.push_back(column.bodypart);
    if (!coordinates.emplace(column.coordinate, i).second) {
      throw std::runtime_error(fmt::format("{}: {} of {} {} occurs in two columns", file.string(),
                                           column.coordinate, column.individual, column.bodypart));
    }
  }
  std::vector<Individual> individuals;
  for (const std::string& name : names) {
    if (name == kNoAnimal && names.size() > 1) {
      notes.add(fmt::format("{}: keypoints that belong to no animal (individual \"{}\") are left out: {}",
                            file.filename().string(), name, found[name].bodyparts.size()));
      continue;
    }
    const std::string where = name.empty() ? file.string() : fmt::format("{}: {}", file.string(), name);
    individuals.push_back({name, in_order(found[name], topology, where)});
  }
  return individuals;
}

// Maps the number of a frame to the picture whose name ends in it ("frames/img0012.png"). The predictions of
// a video have no other link to their pictures.
class NumberedPictures {
 public:
  explicit NumberedPictures(const fs::path& folder) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      const std::string stem = entry.path().stem().string();
      const std::size_t first = stem.find_last_not_of("0123456789") + 1;  // npos + 1 = 0
      std::int64_t number = 0;
      const char* end = stem.data() + stem.size();
      if (std::from_chars(stem.data() + first, end, number).ec == std::errc()) {
        names_[number].insert(entry.path().filename().string());
      }
    }
  }

  // Returns the number itself if there is no such picture or more than one. No file has that name, so the
  // record fails.
  std::string name_of(const std::string& row) const {
    std::int64_t number = -1;
    std::from_chars(row.data(), row.data() + row.size(), number);
    const auto found = names_.find(number);
    return found == names_.end() || found->second.size() != 1 ? row : *found->second.begin();
  }

 private:
  std::map<std::int64_t, std::set<std::string>> names_;
};

// Without a likelihood, v is 1, which means labelled. A point without coordinates is not labelled, whatever
// its likelihood.
bool set_point(const LabelTable& table, std::size_t row, const PointColumns& columns, Keypoint& point) {
  const double x = table.at(row, columns.x);
  const double y = table.at(row, columns.y);
  point = {};
  if (std::isnan(x) || std::isnan(y)) return true;
  const double v = columns.likelihood ? table.at(row, *columns.likelihood) : 1.0;
  return set_keypoint(x, y, v, point);
}

bool is_absent(const LabelTable& table, std::size_t row, const Individual& individual) {
  return std::all_of(individual.points.begin(), individual.points.end(), [&](const PointColumns& columns) {
    Keypoint point;
    return set_point(table, row, columns, point) && point.weight == 0.0F;
  });
}

class DeepLabCutLoader {
 public:
  explicit DeepLabCutLoader(const DatasetOptions& options)
      : loading_(options, {}),
        topology_(keypoints::read_topology_file(options.topology)),
        weights_(options.min_confidence) {
    loading_.more_files.push_back(options.topology);
  }

  Dataset load() {
    const std::vector<fs::path> files = label_files();
    loading_.file = files.front();
    loading_.more_files.insert(loading_.more_files.begin(), files.begin() + 1, files.end());
    for (const fs::path& file : files) read_file(file);
    name_samples();
    if (absent_ > 0)
      loading_.notes.add(
          fmt::format("individuals that have no keypoint in a frame and are left out there: {}", absent_));
    if (const std::string note = weights_.note(); !note.empty()) loading_.notes.add(note);
    if (loading_.options.species.empty()) {
      loading_.notes.add(
          "DeepLabCut's files state no species; set the key \"species\" of the dataset to give one");
    }
    return finished(loading_, std::move(records_));
  }

 private:
  // Returns the file that is named, or a project's labels below the folder that is named: CollectedData_*.h5,
  // and the .csv where there is no .h5 beside it.
  std::vector<fs::path> label_files() const {
    const fs::path given = loading_.file;
    if (!fs::is_directory(given)) return {given};
    std::set<fs::path> found;
    for (const auto& entry : fs::recursive_directory_iterator(given)) {
      const fs::path& path = entry.path();
      if (!path.filename().string().starts_with("CollectedData_") || !entry.is_regular_file()) continue;
      const bool is_hdf5 = path.extension() == ".h5";
      const bool is_lone_csv =
          path.extension() == ".csv" && !fs::exists(fs::path(path).replace_extension(".h5"));
      if (is_hdf5 || is_lone_csv) found.insert(path);
    }
    if (!found.empty()) return {found.begin(), found.end()};
    throw std::runtime_error(fmt::format(
        "{}: got a folder without labels, expected DeepLabCut's CollectedData_*.h5 or .csv in or below it",
        given.string()));
  }

  void read_file(const fs::path& file) {
    const LabelTable table = read_label_table(file);
    const std::vector<Individual> individuals = individuals_of(table, topology_, file, loading_.notes);
    std::optional<NumberedPictures> numbered;
    if (table.rows_are_numbers && !table.rows.empty()) {
      numbered.emplace(loading_.options.root / loading_.options.images);
      loading_.notes.add(
          fmt::format("{}: the rows are frame numbers; each row takes the picture in \"images\" whose name "
                      "ends in its number",
                      file.filename().string()));
    }
    for (std::size_t row = 0; row < table.rows.size(); ++row) {
      const std::string picture = numbered ? numbered->name_of(table.rows[row]) : table.rows[row];
      for (const Individual& individual : individuals) {
        if (is_absent(table, row, individual)) {
          ++absent_;
        } else {
          add_sample(table, row, individual, file, picture);
        }
      }
    }
  }

  void add_sample(const LabelTable& table, std::size_t row, const Individual& individual,
                  const fs::path& file, const std::string& picture) {
    static const nlohmann::json kNoRecord = nlohmann::json::object();
    SampleRecord& sample = records_.emplace_back();
    annotations_.push_back(individual.name.empty() ? "0" : individual.name);
    const std::string who = individual.name.empty() ? "" : ", " + individual.name;
    RecordReader reader(kNoRecord, fmt::format("{}: row {}{}", file.string(), row, who), sample);
    std::vector<Keypoint> points(individual.points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const PointColumns& columns = individual.points[i];
      if (set_point(table, row, columns, points[i])) continue;
      reader.fail(Reason::keypoints_not_finite, topology_.keypoints[i],
                  fmt::format("({}, {})", table.at(row, columns.x), table.at(row, columns.y)),
                  fmt::format("a position within {} px and a finite likelihood", kMaxCoordinatePx));
    }
    set_picture(loading_, reader, picture, "picture", annotations_.back(), sample);
    weights_.apply(points);
    sample.keypoints = keypoints::to_animal3d(topology_, points);
    check_visible(reader, "keypoints", sample);
    if (const auto box = pictures::box_around(points, loading_.options.box_margin)) sample.box = *box;
    check_box(reader, "box around the keypoints", sample);
    sample.species = species::normalised_species(loading_.options.species);
    set_family(loading_, std::nullopt, species::family_of_species(sample.species), sample);
  }

  // Makes ids end in the individual if that makes all of them unique, else in the sample's index.
  void name_samples() {
    std::set<std::string> ids;
    for (const SampleRecord& record : records_) ids.insert(record.id);
    if (ids.size() == records_.size()) return;
    loading_.notes.add(
        "a picture occurs in several rows, so the ids number the samples in the order of the rows");
    for (std::size_t i = 0; i < records_.size(); ++i) {
      std::string& id = records_[i].id;
      id.replace(id.size() - annotations_[i].size(), annotations_[i].size(), std::to_string(i));
    }
  }

  Loading loading_;
  keypoints::Topology topology_;
  keypoints::ConfidenceWeights weights_;
  std::vector<SampleRecord> records_;
  std::vector<std::string> annotations_;  // the last part of each record's id
  std::size_t absent_ = 0;
};

}  // namespace

Dataset load_deeplabcut(const DatasetOptions& options) {
  return DeepLabCutLoader(options).load();
}

}  // namespace q3d::loaders::formats
