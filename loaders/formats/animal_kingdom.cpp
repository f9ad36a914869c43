// Loads Animal Kingdom's pose part: 23 keypoints, as a list of MPII-style records or as COCO.
#include <fmt/format.h>

#include <cmath>

#include "loaders/formats/coco.h"
#include "loaders/formats/other_tools.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Reason;
using manifests::SampleRecord;

constexpr double kMpiiScalePx = 200.0;  // `scale` is the longer side of the box in units of this

const keypoints::Topology& kingdom() {
  return keypoints::topology("animal_kingdom23");
}

// Reads species and family. Fails a sample whose animal the body of a quadruped cannot represent.
void add_animal(Loading& loading, RecordReader& reader, SampleRecord& sample) {
  const species::AnimalClass animal{reader.optional_text("animal_parent_class"),
                                    reader.optional_text("animal_class"),
                                    reader.optional_text("animal_subclass"), reader.optional_text("animal")};
  sample.species = species::normalised_species(animal.animal);
  const std::string rule = species::not_a_quadruped(animal);
  if (!rule.empty()) {
    reader.fail(Reason::not_a_quadruped, "animal", rule, "a four-legged mammal");
  } else {
    set_family(loading, std::nullopt, species::family_of(animal), sample);
  }
}

// The list has no box. `center` and `scale` give a square with the same centre and longer side.
manifests::Box read_mpii_box(RecordReader& reader) {
  const auto center = reader.numbers("center", 2, 1, Reason::box_missing, Reason::record_malformed);
  const auto scale = reader.number("scale");
  if (!scale) reader.fail(Reason::box_missing, "scale", "nothing", "the box's longer side / 200 px");
  if (center.empty() || !scale) return {};
  const double side_px = *scale * kMpiiScalePx;
  for (const double value : {center[0], center[1], side_px}) {
    if (std::abs(value) <= kMaxCoordinatePx) continue;
    reader.fail(Reason::box_not_finite, "center, scale",
                fmt::format("({}, {}), {}", center[0], center[1], *scale),
                fmt::format("numbers within {} px", kMaxCoordinatePx));
    return {};
  }
  return {center[0] - side_px / 2.0, center[1] - side_px / 2.0, side_px, side_px};
}

std::vector<manifests::Keypoint> read_mpii_keypoints(RecordReader& reader) {
  const std::size_t count = kingdom().keypoints.size();
  const auto positions =
      reader.numbers("joints", count, 2, Reason::keypoints_missing, Reason::keypoints_wrong_length);
  const auto visible =
      reader.numbers("joints_vis", count, 1, Reason::keypoints_missing, Reason::keypoints_wrong_length);
  std::vector<manifests::Keypoint> points(count);
  if (positions.empty() || visible.empty()) return points;
  for (std::size_t i = 0; i < count; ++i) {
    if (!set_keypoint(positions[2 * i], positions[2 * i + 1], visible[i], points[i])) {
      reader.fail(Reason::keypoints_not_finite, fmt::format("joints[{}]", i),
                  fmt::format("({}, {}), joints_vis {}", positions[2 * i], positions[2 * i + 1], visible[i]),
                  fmt::format("a position within {} px", kMaxCoordinatePx));
    }
  }
  return points;
}

SampleRecord read_mpii_record(const nlohmann::json& record, std::size_t index, Loading& loading) {
  SampleRecord sample;
  RecordReader reader(record, fmt::format("{}: record [{}]", loading.file.string(), index), sample);
  set_picture(loading, reader, {{reader.text("image"), "image"}}, std::to_string(index), sample);
  add_animal(loading, reader, sample);
  sample.box = read_mpii_box(reader);
  check_box(reader, "center, scale", sample);
  const std::vector<manifests::Keypoint> points = read_mpii_keypoints(reader);
  note_placeholders(loading, points, sample);
  sample.keypoints = keypoints::to_animal3d(kingdom(), points);
  check_visible(reader, "joints_vis", sample);
  return sample;
}

}  // namespace

Dataset load_animal_kingdom(const DatasetOptions& options) {
  Loading loading(options, "dataset");
  const nlohmann::json document = manifests::read_json_file(loading.file);
  refuse_other_form(document, options.format, loading.file);
  if (!document.is_array()) {
    const auto add = [](Loading& here, RecordReader& annotation, const CocoCategory&, SampleRecord& sample) {
      add_animal(here, annotation, sample);
    };
    return load_coco(document, kingdom(), loading, {.add = add});
  }
  std::vector<SampleRecord> records;
  records.reserve(document.size());
  for (std::size_t i = 0; i < document.size(); ++i) {
    records.push_back(read_mpii_record(document[i], i, loading));
  }
  return finished(loading, std::move(records));
}

}  // namespace q3d::loaders::formats
