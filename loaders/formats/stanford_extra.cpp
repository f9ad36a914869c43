// Loads StanfordExtra, a list of dogs, [{img_path, img_width, img_height, img_bbox, joints, ...}, ...], whose
// pictures are those of Stanford Dogs. Version 12 has 24 joints; its first release has the first 20 of them.
#include <fmt/format.h>

#include <stdexcept>

#include "loaders/formats/formats.h"
#include "loaders/formats/other_tools.h"
#include "loaders/keypoints/topology_file.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Keypoint;
using manifests::SampleRecord;

constexpr std::size_t kFirstRelease = 20;
constexpr const char* kSpecies = "dog";

// Reads x, y, v of each joint; v is 1 or 0. Joints that the first release lacks stay unlabelled.
std::vector<Keypoint> read_joints(const nlohmann::json& record, RecordReader& reader, std::size_t count) {
  const bool is_first_release = record.is_object() && record.contains("joints") &&
                                record["joints"].is_array() && record["joints"].size() == kFirstRelease;
  std::vector<Keypoint> joints = reader.keypoints("joints", is_first_release ? kFirstRelease : count);
  joints.resize(count);
  return joints;
}

SampleRecord read_dog(const nlohmann::json& record, std::size_t index, const keypoints::Topology& topology,
                      Loading& loading) {
  SampleRecord sample;
  RecordReader reader(record, fmt::format("{}: record [{}]", loading.file.string(), index), sample);
  set_picture(loading, reader, {{reader.text("img_path"), "img_path"}}, std::to_string(index), sample);
  sample.width_px = reader.size_px("img_width");
  sample.height_px = reader.size_px("img_height");
  const std::vector<Keypoint> joints = read_joints(record, reader, topology.keypoints.size());
  note_placeholders(loading, joints, sample);
  sample.keypoints = keypoints::to_animal3d(topology, joints);
  sample.box = read_or_make_box(loading, reader, "img_bbox", joints, sample);
  check_box(reader, "img_bbox", sample);
  check_visible(reader, "joints", sample);
  sample.species = kSpecies;
  set_family(loading, std::nullopt, species::family_of_species(sample.species), sample);
  return sample;
}

}  // namespace

Dataset load_stanford_extra(const DatasetOptions& options) {
  Loading loading(options, "Images");
  const keypoints::Topology topology = keypoints::read_topology_file("stanfordextra");
  const nlohmann::json document = manifests::read_json_file(loading.file);
  refuse_other_form(document, options.format, loading.file);
  if (!document.is_array()) {
    throw std::runtime_error(fmt::format("{}: top level: got {}, expected StanfordExtra's list of records",
                                         loading.file.string(), manifests::describe(document)));
  }
  std::vector<SampleRecord> records;
  records.reserve(document.size());
  for (std::size_t i = 0; i < document.size(); ++i) {
    records.push_back(read_dog(document[i], i, topology, loading));
  }
  return finished(loading, std::move(records));
}

}  // namespace q3d::loaders::formats
