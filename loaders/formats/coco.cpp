#include "loaders/formats/coco.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "loaders/pictures/box.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Reason;
using manifests::SampleRecord;

std::optional<std::int64_t> id_in(const nlohmann::json& object, const char* key) {
  if (!object.is_object()) return std::nullopt;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number_integer()) return std::nullopt;
  return found->get<std::int64_t>();
}

std::vector<std::string> names_in(const nlohmann::json& category) {
  std::vector<std::string> names;
  for (const auto& name : category["keypoints"]) {
    names.push_back(name.is_string() ? name.get<std::string>() : manifests::describe(name));
  }
  return names;
}

// Returns the keypoint names that the categories list; empty if none lists any.
std::vector<std::string> keypoint_names(const nlohmann::json& document, const Loading& loading) {
  std::vector<std::string> names;
  const auto categories = document.find("categories");
  if (categories == document.end() || !categories->is_array()) return names;
  for (std::size_t i = 0; i < categories->size(); ++i) {
    const nlohmann::json& category = (*categories)[i];
    const bool lists_any = category.is_object() && category.contains("keypoints") &&
                           category["keypoints"].is_array() && !category["keypoints"].empty();
    if (!lists_any) continue;
    std::vector<std::string> here = names_in(category);
    if (!names.empty() && here != names) {
      throw std::runtime_error(fmt::format(
          "{}: categories[{}]: keypoints: got names that differ from those of an earlier category, "
          "expected the same list of keypoints in all categories of a file",
          loading.file.string(), i));
    }
    names = std::move(here);
  }
  return names;
}

std::vector<int> order_of(const nlohmann::json& document, const keypoints::Topology& topology,
                          Loading& loading) {
  std::vector<int> in_order(topology.keypoints.size());
  std::iota(in_order.begin(), in_order.end(), 0);
  const std::vector<std::string> names = keypoint_names(document, loading);
  if (names.empty()) {
    loading.notes.add(fmt::format(
        "no category lists the names of its keypoints; they are read in the order of the topology {}",
        topology.name));
    return in_order;
  }
  try {
    std::vector<int> order = keypoints::order_in_file(topology, names);
    if (order != in_order) {
      loading.notes.add(fmt::format(
          "the file's keypoints are not in the order of the topology {}; they are matched by name",
          topology.name));
    }
    return order;
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(
        fmt::format("{}: categories: keypoints: {}", loading.file.string(), error.what()));
  }
}

struct CocoFile {
  const nlohmann::json& annotations;
  const keypoints::Topology& topology;
  std::vector<int> order;  // place in the file of each keypoint of the topology
  std::unordered_map<std::int64_t, const nlohmann::json*> image_of_id;  // an object, or a file name alone
  bool ids_are_distinct = false;                                        // of the annotations
};

// Indexes the images by id. If several have the same id, the first is used. Returns how many repeat an id.
std::size_t index_images(const nlohmann::json& images, CocoFile& file) {
  std::size_t repeated = 0;
  for (const auto& [key, image] : images.items()) {
    std::optional<std::int64_t> id = id_in(image, "id");
    if (images.is_object()) {
      std::int64_t number = 0;
      const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), number);
      id = error == std::errc() && end == key.data() + key.size() ? std::optional(number) : std::nullopt;
    }
    if (id && !file.image_of_id.emplace(*id, &image).second) ++repeated;
  }
  return repeated;
}

const nlohmann::json& images_of(const nlohmann::json& document, const Loading& loading) {
  const bool is_map = document.is_object() && document.contains("images") && document["images"].is_object();
  return is_map ? document["images"] : manifests::array_of(document, "images", loading.file);
}

CocoFile index_file(const nlohmann::json& document, const keypoints::Topology& topology, Loading& loading) {
  const nlohmann::json& images = images_of(document, loading);
  CocoFile file{.annotations = manifests::array_of(document, "annotations", loading.file),
                .topology = topology,
                .order = order_of(document, topology, loading),
                .image_of_id = {}};
  if (const std::size_t repeated = index_images(images, file); repeated > 0) {
    loading.notes.add(fmt::format(
        "images that repeat the id of an earlier image (the first image of an id is used): {}", repeated));
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

// Reads picture, size and sub-dataset from the image that the annotation points to.
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
  if (found->second->is_string()) {
    set_picture(loading, annotation, found->second->get<std::string>(), "image_id", name, sample);
    return;
  }
  RecordReader image(*found->second, fmt::format("{}: the image of id {}", loading.file.string(), *id),
                     sample);
  set_picture(loading, image, image.text("file_name"), "file_name", name, sample);
  sample.width_px = image.size_px("width");
  sample.height_px = image.size_px("height");
  sample.source = image.optional_text("source_dataset");
}

// Reads an annotation. If it has no box and the rules allow it, returns a box around the keypoints;
// sample.box is then NaN.
std::optional<manifests::Box> read_annotation(const CocoFile& file, std::size_t index, Loading& loading,
                                              RecordReader& annotation, const CocoRules& rules,
                                              SampleRecord& sample) {
  read_image(file, index, loading, annotation, sample);
  const bool makes_box = rules.box_margin && !annotation.has("bbox");
  if (!makes_box) sample.box = annotation.box("bbox");  // the four numbers as they stand
  const std::vector<manifests::Keypoint> in_file = annotation.keypoints("keypoints", file.order.size());
  std::vector<manifests::Keypoint> points(file.order.size());
  std::transform(file.order.begin(), file.order.end(), points.begin(),
                 [&](int place) { return in_file[static_cast<std::size_t>(place)]; });
  if (rules.weigh) rules.weigh(points);
  sample.keypoints = keypoints::to_animal3d(file.topology, points);
  rules.add(loading, annotation, sample);
  check_visible(annotation, "keypoints", sample);
  if (!makes_box || annotation.failed()) return std::nullopt;
  sample.box.x_px = std::numeric_limits<double>::quiet_NaN();
  return pictures::box_around(points, *rules.box_margin);
}

}  // namespace

Dataset load_coco(const nlohmann::json& document, const keypoints::Topology& topology, Loading& loading,
                  const CocoRules& rules) {
  const CocoFile file = index_file(document, topology, loading);
  std::vector<SampleRecord> records(file.annotations.size());
  std::vector<std::optional<manifests::Box>> made_boxes(records.size());
  const auto reader_of = [&](std::size_t index) {
    return RecordReader(file.annotations[index],
                        fmt::format("{}: annotations[{}]", loading.file.string(), index), records[index]);
  };
  for (std::size_t i = 0; i < records.size(); ++i) {
    RecordReader reader = reader_of(i);
    made_boxes[i] = read_annotation(file, i, loading, reader, rules, records[i]);
  }
  const pictures::BoxVote vote = pictures::vote_on_boxes(records);
  if (vote.corners > 0) {
    loading.notes.add(fmt::format(
        "boxes: {} records fit only as x1, y1, x2, y2 and {} only as x, y, width, height; all are read as {}",
        vote.corners, vote.extents, vote.is_corners() ? "x1, y1, x2, y2" : "x, y, width, height"));
  }
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (made_boxes[i]) {
      records[i].box = *made_boxes[i];
      loading.notes.count(fmt::format("no box: it was made around the keypoints, with a margin of {} of its "
                                      "longer side",
                                      *rules.box_margin),
                          records[i].id);
    } else if (vote.is_corners()) {
      records[i].box = pictures::box_from_corners(records[i].box);
    }
    RecordReader reader = reader_of(i);
    check_box(reader, "bbox", records[i]);
  }
  return finished(loading, std::move(records));
}

}  // namespace q3d::loaders::formats
