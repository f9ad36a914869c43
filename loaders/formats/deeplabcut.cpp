// Loads DeepLabCut's own files: labels made by hand (CollectedData_*) and predictions with likelihoods, as
// .h5 or .csv, of one animal or several.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "loaders/formats/deeplabcut_files.h"
#include "loaders/formats/formats.h"
#include "loaders/formats/label_table.h"
#include "loaders/formats/numbered_pictures.h"
#include "loaders/keypoints/confidence.h"
#include "loaders/keypoints/name_match.h"
#include "loaders/keypoints/topology_file.h"
#include "loaders/pictures/box.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using manifests::Keypoint;
using manifests::Reason;
using manifests::SampleRecord;

// DeepLabCut puts keypoints that belong to no animal under this individual.
constexpr std::string_view kNoAnimal = "single";

struct PointColumns {
  bool is_there = false;  // false: the file lacks the keypoint
  std::size_t x = 0;
  std::size_t y = 0;
  std::optional<std::size_t> likelihood{};
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

std::vector<PointColumns> in_order(const FoundColumns& found, const keypoints::NameMatch& match,
                                   const std::string& where) {
  std::vector<PointColumns> points;
  for (const int place : match.places) {
    PointColumns& point = points.emplace_back();
    if (place < 0) continue;
    const std::string& bodypart = found.bodyparts[static_cast<std::size_t>(place)];
    const auto& columns = found.of_bodypart.at(bodypart);
    const auto x = columns.find("x");
    const auto y = columns.find("y");
    const auto likelihood = columns.find("likelihood");
    if (x == columns.end() || y == columns.end()) {
      throw std::runtime_error(fmt::format("{}: {}: expected a column x and a column y", where, bodypart));
    }
    point = {.is_there = true, .x = x->second, .y = y->second};
    if (likelihood != columns.end()) point.likelihood = likelihood->second;
  }
  return points;
}

keypoints::NameMatch match_bodyparts(const keypoints::Topology& topology, const FoundColumns& found,
                                     const std::string& where) {
  try {
    return keypoints::match_names(topology, found.bodyparts);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("{}: bodyparts: {}", where, error.what()));
  }
}

// `bodypart_notes` receives the keypoints that the file lacks and those that the topology does not know.
std::vector<Individual> individuals_of(const LabelTable& table, const keypoints::Topology& topology,
                                       const fs::path& file, Notes& notes,
                                       std::set<std::string>& bodypart_notes) {
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
    const keypoints::NameMatch match = match_bodyparts(topology, found[name], where);
    if (std::string note = match.note(topology); !note.empty()) bodypart_notes.insert(std::move(note));
    individuals.push_back({name, in_order(found[name], match, where)});
  }
  return individuals;
}

// Without a likelihood, v is 1, which means labelled. A point without coordinates is not labelled, whatever
// its likelihood.
bool set_point(const LabelTable& table, std::size_t row, const PointColumns& columns, Keypoint& point) {
  point = {};
  if (!columns.is_there) return true;
  const double x = table.at(row, columns.x);
  const double y = table.at(row, columns.y);
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
          "files of this format state no species; set the key \"species\" of the dataset to give one");
    }
    return finished(loading_, std::move(records_));
  }

 private:
  // Returns `annotations` if it is a file, or the label files of the project in that folder.
  std::vector<fs::path> label_files() {
    const fs::path given = loading_.file;
    if (!fs::is_directory(given)) return {given};
    is_project_ = true;
    return project_label_files(given, loading_.options.root, loading_.notes);
  }

  void read_file(const fs::path& file) {
    const LabelTable table = read_label_table(file);
    if (is_project_) compare_with_csv(table, file);
    std::set<std::string> bodypart_notes;
    const std::vector<Individual> individuals =
        individuals_of(table, topology_, file, loading_.notes, bodypart_notes);
    for (const std::string& note : bodypart_notes) {
      loading_.notes.count_files(note, name_for_people(file), NoteKind::caution);
    }
    const std::vector<PicturePlace> pictures =
        table.rows_are_numbers ? numbered_pictures(table, file) : named_pictures(table, file);
    for (std::size_t row = 0; row < table.rows.size(); ++row) {
      for (const Individual& individual : individuals) {
        if (is_absent(table, row, individual)) {
          ++absent_;
        } else {
          add_sample(table, row, individual, file, pictures[row]);
        }
      }
    }
  }

  // DeepLabCut writes each table twice, and people who edit one of the two expect their labels to count.
  void compare_with_csv(const LabelTable& table, const fs::path& file) {
    const fs::path csv = fs::path(file).replace_extension(".csv");
    if (csv == file || !fs::is_regular_file(csv)) return;
    std::string difference;
    try {
      difference = difference_of(table, read_label_csv(csv));
    } catch (const std::runtime_error&) {
      difference = "which cannot be read";
    }
    loading_.more_files.push_back(csv);
    if (difference.empty()) return;
    loading_.notes.add(
        fmt::format(
            "{} is read, and not {}, {}. If the .csv is right, name it in \"annotations\", or remove the "
            ".h5",
            name_for_people(file), csv.filename().string(), difference),
        NoteKind::caution);
  }

  // The picture of a row: its name, which becomes part of the sample's id, and the folder in which it is
  // looked for first.
  struct PicturePlace {
    std::string name;
    fs::path beside{};  // empty: only the name counts
  };

  // Returns the pictures of rows that are frame numbers. Frames of different videos share numbers, so the
  // pictures of each video are looked for in a folder with the video's name.
  std::vector<PicturePlace> numbered_pictures(const LabelTable& table, const fs::path& file) {
    const std::size_t videos = std::max<std::size_t>(table.videos.size(), 1);
    std::vector<PicturePlace> pictures(table.rows.size());
    for (std::size_t video = 0; video < videos; ++video) {
      std::vector<std::size_t> places;
      for (std::size_t row = 0; row < table.rows.size(); ++row) {
        if (videos == 1 || table.video_of_row[row] == video) places.push_back(row);
      }
      const std::string folder = videos == 1 ? std::string() : table.videos[video].name;
      number_pictures(table, places, folder, file, pictures);
    }
    if (videos > 1) {
      loading_.notes.add(
          fmt::format("{}: the frames of its {} videos are looked for in folders that have the "
                      "videos' names, below \"images\"",
                      name_for_people(file), videos));
    }
    return pictures;
  }

  // Sets the pictures of the rows at `places`. These pictures lie in `subfolder` of the folder of pictures.
  void number_pictures(const LabelTable& table, const std::vector<std::size_t>& places,
                       const std::string& subfolder, const fs::path& file,
                       std::vector<PicturePlace>& pictures) {
    if (places.empty()) return;
    std::vector<std::string> rows;
    rows.reserve(places.size());
    for (const std::size_t place : places) rows.push_back(table.rows[place]);
    const fs::path folder = loading_.options.root / loading_.options.images / subfolder;
    const NumberedPictures numbered(folder);
    const std::optional<int> first_frame = loading_.options.first_frame;
    if (const std::string doubt = numbered.doubt(rows); !first_frame && !doubt.empty()) {
      throw std::runtime_error(fmt::format(
          "{}: got {} in {}, so it is not certain which picture shows which frame; expected pictures with "
          "the frames' own numbers. Set the key \"first_frame\" of the dataset to the number of the picture "
          "that shows frame 0: 1 for pictures that ffmpeg numbered, 0 if the pictures have the frames' own "
          "numbers",
          file.string(), doubt, folder.string()));
    }
    if (!first_frame && numbered.may_be_every_nth(rows)) {
      loading_.notes.add(
          fmt::format(
              "{}: {} has fewer pictures than there are frames, numbered from 0 without a gap. They are "
              "taken "
              "for the first frames. If they are every n-th frame of the video, the labels lie on the wrong "
              "pictures: give the pictures the frames' own numbers",
              name_for_people(file), folder.lexically_normal().string()),
          NoteKind::caution);
    }
    loading_.notes.add(fmt::format(
        "{}: the rows are frame numbers; each row takes the picture in \"images\" "
        "whose name ends in its number{}",
        name_for_people(file), first_frame ? fmt::format(" plus first_frame {}", *first_frame) : ""));
    for (std::size_t i = 0; i < places.size(); ++i) {
      const std::string name = numbered.name_of(rows[i], first_frame.value_or(0));
      pictures[places[i]] = {subfolder.empty() ? name : subfolder + "/" + name};
    }
  }

  // DeepLabCut keeps the labels of a folder of pictures in that folder, so pictures are looked for there
  // first: the folder may have been renamed since, or the rows may name no folder. A table whose rows name
  // several folders was merged from several tables, so only the names count.
  std::vector<PicturePlace> named_pictures(const LabelTable& table, const fs::path& file) const {
    std::set<std::string> folders;
    for (const std::string& row : table.rows) {
      const std::vector<NameReading> readings = readings_of(row);
      folders.insert(readings.empty() ? "" : readings.front().path.parent_path().filename().string());
    }
    const fs::path beside = folders.size() == 1 ? file.parent_path() : fs::path();
    const fs::path own_folder = loading_.finder.relative_to_root(file.parent_path());
    std::vector<PicturePlace> pictures;
    for (const std::string& row : table.rows) {
      const bool has_folder = row.find('/') != std::string::npos;
      pictures.push_back({has_folder ? row : (own_folder / row).generic_string(), beside});
    }
    return pictures;
  }

  std::string name_for_people(const fs::path& file) const {
    const fs::path relative = loading_.finder.relative_to_root(file);
    return relative.empty() ? file.filename().string() : relative.generic_string();
  }

  FoundPicture find_picture(const PicturePlace& picture) {
    if (!picture.beside.empty()) {
      if (auto found = loading_.finder.find_in(picture.beside, picture.name)) return std::move(*found);
    }
    return loading_.finder.find(picture.name);
  }

  void add_sample(const LabelTable& table, std::size_t row, const Individual& individual,
                  const fs::path& file, const PicturePlace& picture) {
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
    set_found_picture(loading_, reader, {picture.name, "picture"}, find_picture(picture), annotations_.back(),
                      sample);
    if (!table.video_of_row.empty()) {
      const LabelVideo& video = table.videos[table.video_of_row[row]];
      sample.width_px = video.width_px;
      sample.height_px = video.height_px;
    }
    note_placeholders(loading_, points, sample);
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
  bool is_project_ = false;  // true if the labels come from a project's folder
};

}  // namespace

Dataset load_deeplabcut(const DatasetOptions& options) {
  return DeepLabCutLoader(options).load();
}

}  // namespace q3d::loaders::formats
