// Loads photographs without keypoints, for `predict`: the pictures of a folder, or a file with the boxes of
// the animals in them (COCO, or MegaDetector's output).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "loaders/formats/coco_ids.h"
#include "loaders/formats/formats.h"
#include "loaders/formats/picture_name.h"
#include "loaders/pictures/picture_header.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using manifests::Reason;
using manifests::SampleRecord;
using nlohmann::json;

constexpr std::array<std::string_view, 3> kExtensions{".jpg", ".jpeg", ".png"};

bool has_picture_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

// Returns the pictures below a folder, sorted by path, so that their order does not depend on the file
// system.
std::vector<fs::path> pictures_below(const fs::path& folder) {
  std::vector<fs::path> pictures;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && has_picture_extension(entry.path())) pictures.push_back(entry.path());
  }
  std::sort(pictures.begin(), pictures.end());
  return pictures;
}

void set_species(const Loading& loading, SampleRecord& sample) {
  sample.species = loading.options.species.empty()
                       ? species::species_of_picture(sample.image_ref, sample.source)
                       : species::normalised_species(loading.options.species);
  sample.family = species::family_of_species(sample.species).value_or(manifests::Family::none);
}

// Sets the size of the picture as its header states it. Returns false if the picture has failed, or its
// header cannot be read; decoding then says what is wrong with it.
bool set_size(SampleRecord& sample) {
  if (sample.failure != Reason::none) return false;
  const auto header = pictures::read_picture_header(sample.image_path);
  if (!header) return false;
  sample.width_px = header->width_px;
  sample.height_px = header->height_px;
  return true;
}

// Makes the whole picture the box: a picture without a box counts as one animal that fills it.
void take_whole_picture(SampleRecord& sample) {
  if (sample.failure != Reason::none) return;
  const bool has_size = set_size(sample);
  sample.box = {0.0, 0.0, has_size ? sample.width_px : 1.0, has_size ? sample.height_px : 1.0};
}

std::vector<SampleRecord> read_folder(Loading& loading, const fs::path& folder) {
  std::vector<SampleRecord> records;
  const json no_fields = json::object();
  for (const fs::path& picture : pictures_below(folder)) {
    SampleRecord& sample = records.emplace_back();
    const std::string name = loading.finder.relative_to_root(fs::canonical(picture)).string();
    RecordReader reader(no_fields, picture.string(), sample);
    set_picture(loading, reader, {{name.empty() ? picture.string() : name, "name"}}, "0", sample);
    take_whole_picture(sample);
    set_species(loading, sample);
  }
  if (records.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: got no picture, expected *.jpg, *.jpeg or *.png in it or below it", folder.string()));
  }
  loading.notes.add(
      fmt::format("each of the {} pictures is taken for one animal that fills it, since no file gives boxes",
                  records.size()));
  return records;
}

bool is_megadetector(const json& document) {
  if (!document.is_object()) return false;
  if (document.contains("detection_categories")) return true;
  const auto images = document.find("images");
  return images != document.end() && images->is_array() && !images->empty() && images->front().is_object() &&
         images->front().contains("detections");
}

// Returns whether a detection is of an animal. MegaDetector also finds people and vehicles.
bool is_animal(const json& document, const json& detection) {
  const auto names = document.find("detection_categories");
  const auto category = detection.find("category");
  if (names == document.end() || !names->is_object() || category == detection.end()) return true;
  const auto name = names->find(category->is_string() ? category->get<std::string>() : category->dump());
  return name == names->end() || *name == "animal";
}

// Returns whether a box has a high enough score, and counts those that do not. A file may state no scores.
bool is_sure(Loading& loading, const json& record, const char* field, const SampleRecord& sample) {
  const auto score = record.find(field);
  if (score == record.end() || !score->is_number()) return true;
  if (score->get<double>() >= loading.options.min_confidence) return true;
  loading.notes.count(fmt::format("boxes with a score below min_confidence ({}) are left out",
                                  loading.options.min_confidence),
                      sample.id);
  return false;
}

// Scales a box to pixels. MegaDetector states boxes as fractions of the picture's size.
void scale_box(RecordReader& reader, SampleRecord& sample) {
  if (!set_size(sample)) return;
  const manifests::Box share = sample.box;
  if (share.x_px + share.w_px > 1.001 || share.y_px + share.h_px > 1.001) {
    reader.fail(Reason::record_malformed, "bbox", "numbers above 1",
                "shares of the picture's width and height");
    return;
  }
  sample.box = {share.x_px * sample.width_px, share.y_px * sample.height_px, share.w_px * sample.width_px,
                share.h_px * sample.height_px};
}

void read_detections(Loading& loading, const json& document, const json& image, std::size_t index,
                     std::vector<SampleRecord>& records) {
  const json detections = image.value("detections", json::array());
  std::size_t others = 0;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    if (!is_animal(document, detections[i])) {
      ++others;
      continue;
    }
    SampleRecord sample;
    const std::string where = fmt::format("{}: images[{}]", loading.file.string(), index);
    RecordReader listed(image, where, sample);
    RecordReader reader(detections[i], fmt::format("{}: detections[{}]", where, i), sample);
    set_picture(loading, listed, {{listed.text("file"), "file"}}, std::to_string(i), sample);
    if (!is_sure(loading, detections[i], "conf", sample)) continue;
    sample.box = reader.box("bbox");
    scale_box(reader, sample);
    check_box(reader, "bbox", sample);
    set_species(loading, sample);
    records.push_back(std::move(sample));
  }
  if (others > 0) {
    loading.notes.count("detections of people and vehicles are left out", image.value("file", std::string()));
  }
}

std::vector<SampleRecord> read_megadetector(Loading& loading, const json& document) {
  std::vector<SampleRecord> records;
  const json& images = manifests::array_of(document, "images", loading.file);
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (images[i].is_object()) read_detections(loading, document, images[i], i, records);
  }
  return records;
}

SampleRecord read_coco_box(Loading& loading, CocoIdMap<const json*>& images, const json& annotation,
                           std::size_t index) {
  SampleRecord sample;
  RecordReader reader(annotation, fmt::format("{}: annotations[{}]", loading.file.string(), index), sample);
  const auto id = coco_id(annotation, "image_id");
  const json* const* image = id ? images.find(*id) : nullptr;
  if (image == nullptr) {
    reader.fail(Reason::image_not_listed, "image_id", id ? id->key() : "nothing", "an id of `images`");
    set_picture(loading, reader, {{"", "image_id"}}, std::to_string(index), sample);
    return sample;
  }
  RecordReader listed(**image, fmt::format("{}: the image of id {}", loading.file.string(), id->key()),
                      sample);
  set_picture(loading, listed, {{listed.text("file_name"), "file_name"}}, std::to_string(index), sample);
  set_size(sample);
  sample.box = reader.box("bbox");
  check_box(reader, "bbox", sample);
  set_species(loading, sample);
  return sample;
}

std::vector<SampleRecord> read_coco_boxes(Loading& loading, const json& document) {
  CocoIdMap<const json*> images;
  for (const json& image : manifests::array_of(document, "images", loading.file)) {
    if (const auto id = coco_id(image, "id")) images.add(*id, &image);
  }
  std::vector<SampleRecord> records;
  const json& annotations = manifests::array_of(document, "annotations", loading.file);
  for (std::size_t i = 0; i < annotations.size(); ++i) {
    SampleRecord sample = read_coco_box(loading, images, annotations[i], i);
    if (is_sure(loading, annotations[i], "score", sample)) records.push_back(std::move(sample));
  }
  return records;
}

}  // namespace

Dataset load_photographs(const DatasetOptions& options) {
  Loading loading(options, "");
  if (fs::is_directory(loading.file)) {
    Dataset dataset = finished(loading, read_folder(loading, loading.file));
    dataset.files.clear();  // a folder has no digest, but every picture has one
    return dataset;
  }
  const json document = manifests::read_json_file(loading.file);
  std::vector<SampleRecord> records =
      is_megadetector(document) ? read_megadetector(loading, document) : read_coco_boxes(loading, document);
  return finished(loading, std::move(records));
}

}  // namespace q3d::loaders::formats
