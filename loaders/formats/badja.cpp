// Loads BADJA. It has a list of frames for each of its videos, [{image_path, segmentation_path, joints,
// visibility}, ...]. A joint is (row, column) of the picture. Its 37 joints are those of the topology
// "badja".
#include <fmt/format.h>

#include <cctype>
#include <set>
#include <stdexcept>

#include "loaders/formats/formats.h"
#include "loaders/formats/other_tools.h"
#include "loaders/keypoints/topology_file.h"
#include "loaders/pictures/box.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using manifests::Keypoint;
using manifests::Reason;
using manifests::SampleRecord;

// Returns the species that a video's file is named after: "cows" -> "cow", "horsejump-high" -> "horse",
// "rs_dog" -> "dog". Empty if no word of the name begins with a species.
std::string species_of_video(const std::string& stem) {
  constexpr std::size_t kShortest = 3;
  std::string word;
  for (std::size_t i = 0; i <= stem.size(); ++i) {
    const bool is_letter = i < stem.size() && std::isalpha(static_cast<unsigned char>(stem[i])) != 0;
    if (is_letter) {
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(stem[i])));
      continue;
    }
    for (; word.size() >= kShortest; word.pop_back()) {
      if (species::family_of_species(word)) return word;
    }
    word.clear();
  }
  return {};
}

// Reads the booleans of `visibility`. Empty if the record fails.
std::vector<bool> read_visibility(const nlohmann::json& record, RecordReader& reader, std::size_t count) {
  if (!reader.has("visibility")) {
    reader.fail(Reason::keypoints_missing, "visibility", "nothing", fmt::format("{} truth values", count));
    return {};
  }
  const nlohmann::json& list = record["visibility"];
  std::vector<bool> visible;
  for (const nlohmann::json& value : list.is_array() ? list : nlohmann::json::array()) {
    const bool is_truth_value = value.is_boolean() || value == 0 || value == 1;
    if (is_truth_value) visible.push_back(value.is_boolean() ? value.get<bool>() : value == 1);
  }
  if (visible.size() == count) return visible;
  reader.fail(Reason::keypoints_wrong_length, "visibility", manifests::describe(list),
              fmt::format("{} truth values", count));
  return {};
}

std::vector<Keypoint> read_joints(const nlohmann::json& record, RecordReader& reader, std::size_t count) {
  const auto positions =
      reader.numbers("joints", count, 2, Reason::keypoints_missing, Reason::keypoints_wrong_length);
  const auto visible = read_visibility(record, reader, count);
  std::vector<Keypoint> points(count);
  if (positions.empty() || visible.empty()) return points;
  for (std::size_t i = 0; i < count; ++i) {
    const double row = positions[2 * i];
    const double column = positions[2 * i + 1];
    if (set_keypoint(column, row, visible[i] ? 1.0 : 0.0, points[i])) continue;
    reader.fail(Reason::keypoints_not_finite, fmt::format("joints[{}]", i),
                fmt::format("row {}, column {}", row, column),
                fmt::format("a position within {} px", kMaxCoordinatePx));
  }
  return points;
}

class BadjaLoader {
 public:
  explicit BadjaLoader(const DatasetOptions& options)
      : loading_(options, {}), topology_(keypoints::read_topology_file("badja")) {}

  Dataset load() {
    const std::vector<fs::path> files = annotation_files();
    for (const fs::path& file : files) read_file(file);
    loading_.file = files.front();
    loading_.more_files.assign(files.begin() + 1, files.end());
    return finished(loading_, std::move(records_));
  }

 private:
  std::vector<fs::path> annotation_files() const {
    if (!fs::is_directory(loading_.file)) return {loading_.file};
    std::set<fs::path> found;
    for (const auto& entry : fs::directory_iterator(loading_.file)) {
      if (entry.path().extension() == ".json") found.insert(entry.path());
    }
    if (!found.empty()) return {found.begin(), found.end()};
    throw std::runtime_error(fmt::format(
        "{}: got a folder without .json files, expected BADJA's joint annotations", loading_.file.string()));
  }

  void read_file(const fs::path& file) {
    const nlohmann::json document = manifests::read_json_file(file);
    refuse_other_form(document, loading_.options.format, file);
    if (!document.is_array()) {
      throw std::runtime_error(fmt::format("{}: top level: got {}, expected BADJA's list of frames",
                                           file.string(), manifests::describe(document)));
    }
    const std::string species = species_of_video(file.stem().string());
    for (std::size_t i = 0; i < document.size(); ++i) read_frame(document[i], i, file, species);
  }

  void read_frame(const nlohmann::json& record, std::size_t index, const fs::path& file,
                  const std::string& species) {
    SampleRecord& sample = records_.emplace_back();
    RecordReader reader(record, fmt::format("{}: record [{}]", file.string(), index), sample);
    set_picture(loading_, reader, {{reader.text("image_path"), "image_path"}},
                fmt::format("{}-{}", file.stem().string(), index), sample);
    const std::vector<Keypoint> points = read_joints(record, reader, topology_.keypoints.size());
    note_placeholders(loading_, points, sample);
    sample.keypoints = keypoints::to_animal3d(topology_, points);
    check_visible(reader, "joints", sample);
    if (const auto box = pictures::box_around(points, loading_.options.box_margin)) sample.box = *box;
    check_box(reader, "box around the joints", sample);
    sample.species = species;
    set_family(loading_, std::nullopt, species::family_of_species(species), sample);
  }

  Loading loading_;
  keypoints::Topology topology_;
  std::vector<SampleRecord> records_;
};

}  // namespace

Dataset load_badja(const DatasetOptions& options) {
  return BadjaLoader(options).load();
}

}  // namespace q3d::loaders::formats
