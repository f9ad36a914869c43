#include "loaders/formats/coco.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "loaders/formats/other_tools.h"
#include "loaders/pictures/box.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Reason;
using manifests::SampleRecord;
using nlohmann::json;

struct CocoFile {
  const json& annotations;
  const keypoints::Topology& topology;
  CocoCategories categories;
  CocoIdMap<const json*> images{};                            // each is an object, or only a file name
  std::unordered_map<std::string, std::string> shared_ids{};  // key of a shared id -> the images' names
  bool ids_are_distinct = false;                              // whether all annotations have different ids
};

std::string file_name_of(const json& image) {
  if (image.is_string()) return image.get<std::string>();
  const auto name = image.is_object() ? image.find("file_name") : image.end();
  return name != image.end() && name->is_string() ? name->get<std::string>() : "(no file_name)";
}

// Indexes the images by id. If several of one picture have the same id, the first is used. If they are of
// several pictures, as where files were joined, nobody can tell which one an annotation means.
void index_images(const json& images, CocoFile& file, Loading& loading) {
  std::size_t repeated = 0;
  for (const auto& [key, image] : images.items()) {
    const std::optional<CocoId> id = images.is_object() ? coco_id_of_key(key) : coco_id(image, "id");
    if (!id || file.images.add(*id, &image)) continue;
    const std::string first = file_name_of(**file.images.find(*id));
    const std::string name = file_name_of(image);
    if (name == first) {
      ++repeated;
    } else {
      file.shared_ids.emplace(id->key(), fmt::format("{} and {}", first, name));
    }
  }
  if (repeated > 0) {
    loading.notes.add(
        fmt::format("images that repeat the id of an earlier image of the same name: {}", repeated));
  }
  if (!file.shared_ids.empty()) {
    loading.notes.add(
        fmt::format("ids that several pictures share, as where files were joined; their annotations fail, "
                    "because nobody can tell which picture is meant: {}, first {} ({})",
                    file.shared_ids.size(), file.shared_ids.begin()->first, file.shared_ids.begin()->second),
        NoteKind::caution);
  }
}

const json& images_of(const json& document, const Loading& loading) {
  const bool is_map = document.is_object() && document.contains("images") && document["images"].is_object();
  return is_map ? document["images"] : manifests::array_of(document, "images", loading.file);
}

// Returns the last part of a sample's id. An id that is a text may hold anything.
std::string annotation_part(const CocoFile& file, std::size_t index) {
  if (!file.ids_are_distinct) return std::to_string(index);
  return id_part(coco_id(file.annotations[index], "id")->text);
}

void index_annotations(CocoFile& file, Loading& loading) {
  std::unordered_set<std::string> ids;
  std::unordered_set<const json*> used_images;
  for (const json& annotation : file.annotations) {
    if (const auto id = coco_id(annotation, "id")) ids.insert(id_part(id->text));
    const auto image = coco_id(annotation, "image_id");
    if (const json* const* found = image ? file.images.find(*image) : nullptr) used_images.insert(*found);
  }
  file.ids_are_distinct = ids.size() == file.annotations.size();
  if (file.images.found_as_other_type() > 0) {
    loading.notes.add(fmt::format("image ids are texts in one place of the file and numbers in another; they "
                                  "are taken for the same if the numbers are equal: {} annotations",
                                  file.images.found_as_other_type()),
                      NoteKind::caution);
  }
  if (used_images.size() < file.images.size()) {
    loading.notes.add(
        fmt::format("images without an annotation: {}", file.images.size() - used_images.size()));
  }
}

CocoFile index_file(const json& document, const keypoints::Topology& topology, Loading& loading) {
  refuse_other_form(document, loading.options.format, loading.file);
  const json& images = images_of(document, loading);
  CocoFile file{.annotations = manifests::array_of(document, "annotations", loading.file),
                .topology = topology,
                .categories = CocoCategories(document, topology, loading)};
  index_images(images, file, loading);
  index_annotations(file, loading);
  return file;
}

// Returns the fields of an image that name its picture. coco-annotator writes `path`, and COCO's own files a
// URL that ends in the file's name.
std::vector<PictureName> picture_names(const json& listed, RecordReader& image) {
  std::vector<PictureName> names;
  for (const char* field : {"file_name", "path", "coco_url"}) {
    const auto name = listed.find(field);
    if (name == listed.end() || !name->is_string() || name->get_ref<const std::string&>().empty()) continue;
    names.push_back({name->get<std::string>(), field});
  }
  if (names.empty()) names.push_back({image.text("file_name"), "file_name"});
  return names;
}

// Reads picture, size and sub-dataset from the image that the annotation points to.
void read_image(CocoFile& file, std::size_t index, Loading& loading, RecordReader& annotation,
                SampleRecord& sample) {
  const std::string part = annotation_part(file, index);
  const json& record = file.annotations[index];
  const auto id = coco_id(record, "image_id");
  const json* const* found = id ? file.images.find(*id) : nullptr;
  if (found == nullptr) {
    const bool has_field = annotation.has("image_id");
    const bool is_no_id = has_field && !id;
    annotation.fail(is_no_id ? Reason::record_malformed : Reason::image_not_listed, "image_id",
                    has_field ? manifests::describe(record["image_id"]) : "nothing",
                    is_no_id                        ? "a whole number or a text"
                    : file.images.example().empty() ? "an id of `images`"
                                                    : "an id of `images`, such as " + file.images.example());
    set_picture(loading, annotation, {{"", "image_id"}}, part, sample);
    return;
  }
  const json& listed = **found;
  if (const auto shared = file.shared_ids.find(id->key()); shared != file.shared_ids.end()) {
    annotation.fail(Reason::record_malformed, "image_id",
                    fmt::format("{}, which the images {} share", id->key(), shared->second),
                    "an id that one image has; give the images of joined files ids of their own");
  }
  if (listed.is_string()) {
    set_picture(loading, annotation, {{listed.get<std::string>(), "image_id"}}, part, sample);
    return;
  }
  RecordReader image(listed, fmt::format("{}: the image of id {}", loading.file.string(), id->key()), sample);
  set_picture(loading, image, picture_names(listed, image), part, sample);
  sample.width_px = image.size_px("width");
  sample.height_px = image.size_px("height");
  sample.source = image.optional_text("source_dataset");
}

// COCO's v is 0, 1 or 2, and estimators write a confidence of up to 1 there.
void note_large_v(std::span<const manifests::Keypoint> keypoints, const SampleRecord& sample,
                  Loading& loading) {
  const auto large = std::find_if(keypoints.begin(), keypoints.end(),
                                  [](const manifests::Keypoint& point) { return point.v > 2.0F; });
  if (large == keypoints.end()) return;
  loading.notes.count(
      fmt::format(
          "keypoints whose v is above 2 (such as {}), which COCO does not have, count as labelled by hand; "
          "if v is a confidence, write it from 0 to 1",
          large->v),
      sample.id, NoteKind::caution);
}

// Reads an annotation. If it has no box and the rules allow it, returns a box around the keypoints;
// sample.box is then NaN.
std::optional<manifests::Box> read_annotation(CocoFile& file, std::size_t index, Loading& loading,
                                              RecordReader& annotation, const CocoRules& rules,
                                              SampleRecord& sample) {
  read_image(file, index, loading, annotation, sample);
  const json& record = file.annotations[index];
  const bool makes_box = rules.box_margin && !annotation.has_box("bbox");
  if (!makes_box) sample.box = annotation.box("bbox");  // the four numbers as they stand
  const CocoCategory* category = file.categories.of(record);
  if (category == nullptr) {
    annotation.fail(Reason::record_malformed, "category_id",
                    annotation.has("category_id") ? manifests::describe(record["category_id"]) : "nothing",
                    "the id of a category that lists keypoints");
    return std::nullopt;
  }
  const std::vector<manifests::Keypoint> in_file =
      annotation.keypoints("keypoints", category->keypoints.size());
  note_placeholders(loading, in_file, sample);
  note_large_v(in_file, sample, loading);
  std::vector<manifests::Keypoint> points = keypoints::in_topology_order(category->match, in_file);
  if (rules.weigh) rules.weigh(points);
  sample.keypoints = keypoints::to_animal3d(file.topology, points);
  rules.add(loading, annotation, *category, sample);
  check_visible(annotation, "keypoints", sample);
  if (!makes_box || annotation.failed()) return std::nullopt;
  sample.box.x_px = std::numeric_limits<double>::quiet_NaN();
  return pictures::box_around(points, *rules.box_margin);
}

// Returns the annotations that become records, by their positions in the file.
std::vector<std::size_t> chosen_annotations(CocoFile& file) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < file.annotations.size(); ++i) {
    if (!file.categories.leaves_out(file.annotations[i])) chosen.push_back(i);
  }
  return chosen;
}

// Sets the boxes that were made from keypoints, reads the others in the convention that the vote found, and
// checks all of them.
template <typename ReaderOf>
void settle_boxes(Loading& loading, const CocoRules& rules,
                  const std::vector<std::optional<manifests::Box>>& made_boxes, ReaderOf reader_of,
                  std::vector<SampleRecord>& records) {
  const pictures::BoxVote vote = pictures::vote_on_boxes(records);
  if (vote.corners > 0) {
    loading.notes.add(
        fmt::format(
            "boxes: {} records fit only as x1, y1, x2, y2 and {} only as x, y, width, height; all are "
            "read as {}",
            vote.corners, vote.extents, vote.is_corners() ? "x1, y1, x2, y2" : "x, y, width, height"),
        NoteKind::caution);
  }
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (made_boxes[i]) {
      records[i].box = *made_boxes[i];
      note_made_box(loading, *rules.box_margin, records[i]);
    } else if (vote.is_corners()) {
      records[i].box = pictures::box_from_corners(records[i].box);
    }
    RecordReader reader = reader_of(i);
    check_box(reader, "bbox", records[i]);
  }
}

}  // namespace

Dataset load_coco(const json& document, const keypoints::Topology& topology, Loading& loading,
                  const CocoRules& rules) {
  CocoFile file = index_file(document, topology, loading);
  const std::vector<std::size_t> places = chosen_annotations(file);
  std::vector<SampleRecord> records(places.size());
  std::vector<std::optional<manifests::Box>> made_boxes(records.size());
  const auto reader_of = [&](std::size_t i) {
    return RecordReader(file.annotations[places[i]],
                        fmt::format("{}: annotations[{}]", loading.file.string(), places[i]), records[i]);
  };
  for (std::size_t i = 0; i < records.size(); ++i) {
    RecordReader reader = reader_of(i);
    made_boxes[i] = read_annotation(file, places[i], loading, reader, rules, records[i]);
  }
  settle_boxes(loading, rules, made_boxes, reader_of, records);
  file.categories.add_notes(loading);
  return finished(loading, std::move(records));
}

}  // namespace q3d::loaders::formats
