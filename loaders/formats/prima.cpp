// Loads the JSON of PRIMA and AniMer: {"data": [{img_path, mask_path, bbox, keypoint_2d, ...}, ...]}.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "loaders/formats/formats.h"
#include "loaders/formats/other_tools.h"
#include "loaders/formats/several_animals.h"
#include "manifests/json_elements.h"
#include "manifests/json_file.h"

namespace q3d::loaders::formats {
namespace {

using manifests::BodyTruth;
using manifests::Family;
using manifests::Reason;
using manifests::SampleRecord;

constexpr std::size_t kKeypoints = manifests::kNumKeypoints;
constexpr std::size_t kPoseNumbers = manifests::kNumJoints * 3;
constexpr std::size_t kBetas = manifests::kNumBetas;
constexpr std::size_t kFirstBetas = 20;  // `shape`; the other 21 are `shape_extra`

// Converts values to an array of float. `values` come from a reader that has checked their number, so they
// fit.
template <std::size_t N>
void copy_into(std::array<float, N>& target, const std::vector<double>& values, std::size_t at = 0) {
  std::transform(values.begin(), values.end(), target.begin() + static_cast<std::ptrdiff_t>(at),
                 [](double value) { return static_cast<float>(value); });
}

template <std::size_t N>
bool any_nonzero(const std::array<float, N>& values) {
  return std::any_of(values.begin(), values.end(), [](float value) { return value != 0.0F; });
}

// Returns how many numbers `shape` holds if they are betas of another shape space than SMAL's 41, such as the
// 145 of SMAL+; else 0. Such betas mean something else, so they are no label here; a pose means the same in
// both. A few numbers are not a shape space but a damaged record.
std::size_t betas_of_another_model(const nlohmann::json& shape) {
  constexpr std::size_t kSmallestShapeSpace = 10;
  const bool is_one =
      shape.is_array() && shape.size() >= kSmallestShapeSpace && shape.size() != kBetas &&
      shape.size() != kFirstBetas &&
      std::all_of(shape.begin(), shape.end(), [](const auto& beta) { return beta.is_number(); });
  return is_one ? shape.size() : 0;
}

// Reads the betas. `shape` holds all 41 numbers, or 20 with the other 21 in `shape_extra`, which some exports
// lack.
void read_betas(const nlohmann::json& record, RecordReader& reader, Loading& loading, const std::string& id,
                BodyTruth& truth) {
  if (!reader.has("shape")) return;
  if (const std::size_t count = betas_of_another_model(record["shape"]); count > 0) {
    loading.notes.count(
        fmt::format(
            "shape has {} numbers, which are betas of another body model than SMAL's 41 (or 20 and 21), "
            "so the shape is no label; keypoints and pose are read",
            count),
        id);
    return;
  }
  const bool is_whole = record["shape"].is_array() && record["shape"].size() == kBetas;
  copy_into(truth.betas, reader.finite_numbers("shape", is_whole ? kBetas : kFirstBetas, 1));
  if (is_whole) return;
  if (reader.has("shape_extra")) {
    copy_into(truth.betas, reader.finite_numbers("shape_extra", kBetas - kFirstBetas, 1), kFirstBetas);
  } else {
    loading.notes.count("shape has 20 numbers and shape_extra is missing, so the other 21 betas are 0", id);
  }
}

// A body counts as given only if its numbers are not all zero, because converters write zeros for pictures
// without a body.
std::optional<BodyTruth> read_truth(const nlohmann::json& record, RecordReader& reader, Loading& loading,
                                    const std::string& id) {
  BodyTruth truth;
  if (reader.has("pose")) copy_into(truth.pose_axis_angle, reader.finite_numbers("pose", kPoseNumbers, 1));
  read_betas(record, reader, loading, id, truth);
  if (reader.has("trans")) copy_into(truth.trans, reader.finite_numbers("trans", 3, 1));
  if (reader.has("keypoint_3d")) {
    copy_into(truth.keypoints_3d, reader.numbers("keypoint_3d", kKeypoints, 3, Reason::keypoints_missing,
                                                 Reason::keypoints_wrong_length));
    if (std::any_of(truth.keypoints_3d.begin(), truth.keypoints_3d.end(),
                    [](float value) { return !std::isfinite(value); })) {
      reader.fail(Reason::keypoints_not_finite, "keypoint_3d", "a number that is not finite",
                  "finite numbers");
    }
  }
  truth.has_pose = any_nonzero(truth.pose_axis_angle);
  truth.has_betas = any_nonzero(truth.betas);
  truth.has_keypoints_3d = any_nonzero(truth.keypoints_3d);
  if (!truth.has_pose && !truth.has_betas && !truth.has_keypoints_3d) return std::nullopt;
  return truth;
}

// Reads the family. Both -1 and a missing value mean that it is not stated.
std::optional<Family> read_family(RecordReader& reader) {
  const auto number = reader.integer("supercategory");
  if (!number || *number == -1) return std::nullopt;
  if (*number >= 0 && *number <= static_cast<int>(Family::hippopotamidae))
    return static_cast<Family>(*number);
  reader.fail(Reason::record_malformed, "supercategory", std::to_string(*number),
              "a family from 0 to 4, or -1");
  return std::nullopt;
}

// A mask that does not exist, or is the picture itself (as the official AcinoSet converter writes it), is
// ignored.
void set_mask(RecordReader& reader, Loading& loading, SampleRecord& sample) {
  const std::string name = reader.optional_text("mask_path");
  if (name.empty() || reader.failed()) return;
  FoundPicture mask = loading.finder.find(name);
  if (mask.failure == Reason::none && mask.path == sample.image_path) {
    loading.notes.count("mask_path names the picture itself, so the sample has no mask", sample.id);
  } else if (mask.failure == Reason::none) {
    sample.mask_path = mask.path.string();
  } else if (mask.failure == Reason::image_missing) {
    loading.notes.count("mask_path names a file that does not exist, so the sample has no mask", sample.id);
  } else {
    reader.fail(mask.failure, "mask_path", mask.got, "a mask below the dataset's root");
  }
}

// `place` is the record's place in the file: "12", or "12.1" for the second animal of a record.
SampleRecord read_record(const nlohmann::json& record, const std::string& place, Loading& loading) {
  SampleRecord sample;
  RecordReader reader(record, fmt::format("{}: data[{}]", loading.file.string(), place), sample);
  set_picture(loading, reader, {{reader.text("img_path"), "img_path"}}, place, sample);
  set_mask(reader, loading, sample);
  sample.width_px = reader.size_px("width");
  sample.height_px = reader.size_px("height");
  if (holds_several_animals(record)) {
    reader.fail(Reason::record_malformed, "bbox", fmt::format("boxes of {} animals", record["bbox"].size()),
                "one record an animal, or keypoint_2d, pose and the other fields with one list an animal");
  }
  const auto keypoints = reader.keypoints("keypoint_2d", kKeypoints);
  std::copy(keypoints.begin(), keypoints.end(), sample.keypoints.begin());
  sample.box = read_or_make_box(loading, reader, "bbox", keypoints, sample);
  check_box(reader, "bbox", sample);
  note_placeholders(loading, keypoints, sample);
  check_visible(reader, "keypoint_2d", sample);
  sample.truth = read_truth(record, reader, loading, sample.id);
  sample.species = species::species_of_picture(sample.image_ref, "");
  set_family(loading, read_family(reader), species::family_of_species(sample.species), sample);
  return sample;
}

// Collects records and passes them on in parts.
class RecordParts {
 public:
  explicit RecordParts(const TakeRecords& take) : take_(take) {}

  void add(SampleRecord record) {
    records_.push_back(std::move(record));
    if (records_.size() == kRecordsAtOnce) pass_on();
  }
  void pass_on() {
    bound_texts(records_);
    take_(std::move(records_));
    records_ = {};
  }

 private:
  const TakeRecords& take_;
  std::vector<SampleRecord> records_;
};

}  // namespace

Dataset stream_prima(const DatasetOptions& options, const TakeRecords& take) {
  Loading loading(options, {});
  RecordParts records(take);
  std::size_t index = 0;
  std::size_t split = 0;
  const auto add = [&](const nlohmann::json& record) {
    const std::vector<nlohmann::json> animals = one_record_an_animal(record);
    if (animals.empty()) records.add(read_record(record, std::to_string(index), loading));
    for (std::size_t k = 0; k < animals.size(); ++k) {
      records.add(read_record(animals[k], fmt::format("{}.{}", index, k), loading));
    }
    split += animals.empty() ? 0 : 1;
    ++index;
  };
  const nlohmann::json document =
      manifests::read_json_elements(loading.file, "data", [&](nlohmann::json&& record) { add(record); });
  refuse_other_form(document, options.format, loading.file);
  manifests::array_of(document, "data", loading.file);
  records.pass_on();
  if (split > 0) {
    loading.notes.add(
        fmt::format("records that hold several animals, each of which becomes a sample: {}", split));
  }
  return finished(loading, {});
}

}  // namespace q3d::loaders::formats
