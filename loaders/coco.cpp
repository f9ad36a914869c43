#include "loaders/coco.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "loaders/box.h"
#include "loaders/json_file.h"

namespace q3d::loaders {
namespace {

using manifests::Reason;
using manifests::SampleRecord;

std::optional<std::int64_t> id_in(const nlohmann::json& object, const char* key) {
  if (!object.is_object()) return std::nullopt;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number_integer()) return std::nullopt;
  return found->get<std::int64_t>();
}

// The keypoint names of the first category that lists any; empty when none does.
std::vector<std::string> keypoint_names(const nlohmann::json& document) {
  std::vector<std::string> names;
  const auto categories = document.find("categories");
  if (categories == document.end() || !categories->is_array()) return names;
  for (const auto& category : *categories) {
    const bool lists_any = category.is_object() && category.contains("keypoints") &&
                           category["keypoints"].is_array() && !category["keypoints"].empty();
    if (!lists_any) continue;
    for (const auto& name : category["keypoints"]) {
      names.push_back(name.is_string() ? name.get<std::string>() : describe(name));
    }
    break;
  }
  return names;
}

std::vector<int> order_of(const nlohmann::json& document, const Topology& topology, Loading& loading) {
  std::vector<int> in_order(topology.keypoints.size());
  std::iota(in_order.begin(), in_order.end(), 0);
  const std::vector<std::string> names = keypoint_names(document);
  if (names.empty()) {
    loading.notes.add(
        fmt::format("no category names its keypoints; taken as {} in its own order", topology.name));
    return in_order;
  }
  try {
    std::vector<int> order = order_in_file(topology, names);
    if (order != in_order) {
      loading.notes.add(
          fmt::format("the file's keypoints are not in {}'s order; taken by name", topology.name));
    }
    return order;
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(
        fmt::format("{}: categories: keypoints: {}", loading.file.string(), error.what()));
  }
}

struct CocoFile {
  const nlohmann::json& images;
  const nlohmann::json& annotations;
  const Topology& topology;
  std::vector<int> order;  // place in the file of each keypoint of the topology
  std::unordered_map<std::int64_t, const nlohmann::json*> image_of_id;
  bool ids_are_distinct = false;  // of the annotations
};

CocoFile index_file(const nlohmann::json& document, const Topology& topology, Loading& loading) {
  CocoFile file{.images = array_of(document, "images", loading.file),
                .annotations = array_of(document, "annotations", loading.file),
                .topology = topology,
                .order = order_of(document, topology, loading),
                .image_of_id = {}};
  std::size_t repeated = 0;
  for (const nlohmann::json& image : file.images) {
    const auto id = id_in(image, "id");
    if (id && !file.image_of_id.emplace(*id, &image).second) ++repeated;
  }
  if (repeated > 0) {
    loading.notes.add(fmt::format("images that repeat an id (the first of each is taken): {}", repeated));
  }
  std::unordered_set<std::int64_t> ids;
  std::unordered_set<std::int64_t> used_images;
  for (const nlohmann::json& annotation : file.annotations) {
    if (const auto id = id_in(annotation, "id")) ids.insert(*id);
    if (const auto image = id_in(annotation, "image_id")) used_images.insert(*image);
  }
  file.ids_are_distinct = ids.size() == file.annotations.size();
  const auto unused = std::count_if(file.image_of_id.begin(), file.image_of_id.end(),
                                    [&](const auto& image) { return !used_images.contains(image.first); });
  if (unused > 0) loading.notes.add(fmt::format("images without an annotation: {}", unused));
  return file;
}

// Picture, size and sub-dataset from the image that the annotation points to.
void read_image(const CocoFile& file, std::size_t index, Loading& loading, RecordReader& annotation,
                SampleRecord& sample) {
  const std::string name = std::to_string(file.ids_are_distinct ? *id_in(file.annotations[index], "id")
                                                                : static_cast<std::int64_t>(index));
  const auto id = annotation.integer("image_id");
  const auto found = id ? file.image_of_id.find(*id) : file.image_of_id.end();
  if (found == file.image_of_id.end()) {
    annotation.fail(Reason::image_not_listed, "image_id", id ? std::to_string(*id) : "nothing",
                    "an id of `images`");
    set_picture(loading, annotation, "", "image_id", name, sample);
    return;
  }
  RecordReader image(*found->second, fmt::format("{}: the image of id {}", loading.file.string(), *id),
                     sample);
  set_picture(loading, image, image.text("file_name"), "file_name", name, sample);
  sample.width_px = image.size_px("width");
  sample.height_px = image.size_px("height");
  sample.source = image.optional_text("source_dataset");
}

void read_annotation(const CocoFile& file, std::size_t index, Loading& loading, RecordReader& annotation,
                     CocoAddition add, SampleRecord& sample) {
  read_image(file, index, loading, annotation, sample);
  sample.box = annotation.box("bbox");  // the four numbers as they stand
  const std::vector<manifests::Keypoint> in_file = annotation.keypoints("keypoints", file.order.size());
  std::vector<manifests::Keypoint> points(file.order.size());
  std::transform(file.order.begin(), file.order.end(), points.begin(),
                 [&](int place) { return in_file[static_cast<std::size_t>(place)]; });
  sample.keypoints = to_animal3d(file.topology, points);
  add(loading, annotation, sample);
  check_visible(annotation, "keypoints", sample);
}

}  // namespace

Dataset load_coco(const nlohmann::json& document, const Topology& topology, Loading& loading,
                  CocoAddition add) {
  const CocoFile file = index_file(document, topology, loading);
  std::vector<SampleRecord> records(file.annotations.size());
  const auto reader_of = [&](std::size_t index) {
    return RecordReader(file.annotations[index],
                        fmt::format("{}: annotations[{}]", loading.file.string(), index), records[index]);
  };
  for (std::size_t i = 0; i < records.size(); ++i) {
    RecordReader reader = reader_of(i);
    read_annotation(file, i, loading, reader, add, records[i]);
  }
  const BoxVote vote = vote_on_boxes(records);
  if (vote.corners > 0) {
    loading.notes.add(fmt::format(
        "boxes: {} records fit as x1, y1, x2, y2 alone and {} as x, y, width, height alone; read as {}",
        vote.corners, vote.extents, vote.is_corners() ? "x1, y1, x2, y2" : "x, y, width, height"));
  }
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (vote.is_corners()) records[i].box = box_from_corners(records[i].box);
    RecordReader reader = reader_of(i);
    check_box(reader, "bbox", records[i]);
  }
  return finished(loading, std::move(records));
}

}  // namespace q3d::loaders
