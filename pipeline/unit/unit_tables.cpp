#include "pipeline/unit/unit_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "smal/numbers.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Table;

// Returns one member of every row's body, end to end.
template <typename Row, typename Part, typename Value>
void add_field(Table& table, const std::string& name, const std::vector<Row>& rows,
               std::vector<std::int64_t> row_shape, Value Part::*field) {
  std::vector<float> values;
  values.reserve(rows.size() * smal::NumbersOf<Value>().size());
  for (const Row& row : rows) {
    const smal::NumbersOf<Value> numbers = smal::numbers_of(row.body.*field);
    values.insert(values.end(), numbers.begin(), numbers.end());
  }
  table.add<float>(name, std::move(row_shape), values);
}

template <typename Row, typename Part, typename Value>
void read_field(const Table& table, const std::string& name, std::vector<Row>& rows, Value Part::*field) {
  smal::NumbersOf<Value> numbers;
  const std::span<const float> values = table.column<float>(name, numbers.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(i * numbers.size()), numbers.size(),
                numbers.begin());
    rows[i].body.*field = smal::from_numbers<Value>(numbers);
  }
}

// Visits the fields of a body, so that writing and reading share their names.
template <typename Visitor>
void visit_body(Visitor&& visit) {
  visit("rotations", std::vector<std::int64_t>{manifests::kNumJoints, 3, 3}, &device::BodyPrediction::pose);
  visit("betas", std::vector<std::int64_t>{manifests::kNumBetas}, &device::BodyPrediction::betas);
  visit("camera", std::vector<std::int64_t>{3}, &device::BodyPrediction::camera);
  visit("translation", std::vector<std::int64_t>{3}, &device::BodyPrediction::translation);
  visit("keypoints_3d", std::vector<std::int64_t>{manifests::kNumKeypoints, 3},
        &device::BodyPrediction::keypoints_3d);
  visit("keypoints_2d", std::vector<std::int64_t>{manifests::kNumKeypoints, 2},
        &device::BodyPrediction::keypoints_2d);
  visit("aux_keypoints_2d", std::vector<std::int64_t>{manifests::kNumKeypoints, 2},
        &device::BodyPrediction::aux_keypoints_2d);
  visit("aux_keypoints_3d", std::vector<std::int64_t>{manifests::kNumKeypoints, 3},
        &device::BodyPrediction::aux_keypoints_3d);
}

template <typename Row>
void add_bodies(Table& table, const std::vector<Row>& rows) {
  visit_body([&](const char* name, std::vector<std::int64_t> shape, auto field) {
    add_field(table, name, rows, std::move(shape), field);
  });
}

template <typename Row>
void read_bodies(const Table& table, std::vector<Row>& rows) {
  visit_body([&](const char* name, const std::vector<std::int64_t>&, auto field) {
    read_field(table, name, rows, field);
  });
}

// Adds a column of curves, in which each row has the float64 numbers of its curve.
void add_curves(Table& table, const std::string& name, const std::vector<RefinedSample>& samples,
                std::vector<double> RefinedSample::*curve) {
  auto& blobs = table.blobs[name];
  for (const RefinedSample& sample : samples) {
    const auto bytes = std::as_bytes(std::span(sample.*curve));
    blobs.emplace_back(bytes.begin(), bytes.end());
  }
}

// Reads the curves. Leaves them empty if the table has no such column.
void read_curves(const Table& table, const std::string& name, std::vector<RefinedSample>& samples,
                 std::vector<double> RefinedSample::*curve) {
  const auto blobs = table.blobs.find(name);
  if (blobs == table.blobs.end()) return;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto& bytes = blobs->second[i];
    auto& numbers = samples[i].*curve;
    if (bytes.size() % sizeof(double) != 0) {
      throw std::runtime_error(fmt::format("blob column {}, row {}: got {} bytes, expected numbers of {}",
                                           name, i, bytes.size(), sizeof(double)));
    }
    numbers.resize(bytes.size() / sizeof(double));
    if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), bytes.size());
  }
}

// Returns the columns that are measured. The combined score is computed from them when a unit is judged.
std::span<const manifests::TrustColumn> measured_columns() {
  return std::span(manifests::kTrustColumns).subspan(1);
}

// Reads a reason. reason_from_string() throws std::invalid_argument, which would mean a wrong config.
manifests::Reason reason_in(const std::string& column, const std::string& name) {
  try {
    return manifests::reason_from_string(name);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("text column {}: {}", column, error.what()));
  }
}

std::vector<std::vector<std::byte>>& blob_column(Table& table, const std::string& name) {
  const auto found = table.blobs.find(name);
  if (found == table.blobs.end()) throw std::runtime_error("blob column " + name + " is missing");
  return found->second;
}

// Replaces NULs in a text. The table pads texts with NUL, so none may contain one, but a hostile annotation
// file's may.
std::string storable(std::string text) {
  std::replace(text.begin(), text.end(), '\0', '?');
  return text;
}

void add_candidates(Table& table, std::span<const candidates::Candidate> candidates) {
  std::vector<double> boxes;
  std::vector<double> positions;
  std::vector<float> v;
  std::vector<float> weights;
  for (const candidates::Candidate& candidate : candidates) {
    const manifests::SampleRecord& record = candidate.record;
    table.text["id"].push_back(storable(record.id));
    table.text["image_ref"].push_back(storable(record.image_ref));
    boxes.insert(boxes.end(), {record.box.x_px, record.box.y_px, record.box.w_px, record.box.h_px});
    for (const manifests::Keypoint& point : record.keypoints) {
      positions.insert(positions.end(), {point.x_px, point.y_px});
      v.push_back(point.v);
      weights.push_back(point.weight);
    }
  }
  table.add<double>("box_xywh_px", {4}, boxes);
  table.add<double>("keypoints_px", {manifests::kNumKeypoints, 2}, positions);
  table.add<float>("keypoint_v", {manifests::kNumKeypoints}, v);
  table.add<float>("keypoint_weight", {manifests::kNumKeypoints}, weights);
}

}  // namespace

Table to_table(std::span<const candidates::Candidate> candidates,
               const std::vector<PredictedSample>& samples) {
  Table table;
  table.rows = static_cast<std::int64_t>(samples.size());
  add_candidates(table, candidates);
  std::vector<std::int32_t> image_size;
  std::vector<std::uint8_t> has_mask;
  for (const PredictedSample& sample : samples) {
    image_size.insert(image_size.end(), {sample.image_width_px, sample.image_height_px});
    has_mask.push_back(sample.has_mask ? 1 : 0);
    table.text["failure"].emplace_back(manifests::to_string(sample.failure));
    table.text["detail"].push_back(storable(sample.detail));
  }
  table.add<std::int32_t>("image_size_px", {2}, image_size);
  table.add<std::uint8_t>("has_mask", {}, has_mask);
  add_bodies(table, samples);
  return table;
}

std::vector<PredictedSample> predicted_from_table(const Table& table) {
  std::vector<PredictedSample> samples(static_cast<std::size_t>(table.rows));
  if (samples.empty()) return samples;
  const auto image_size = table.column<std::int32_t>("image_size_px", 2);
  const auto has_mask = table.column<std::uint8_t>("has_mask", 1);
  const auto& failure = table.texts("failure");
  const auto& detail = table.texts("detail");
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].failure = reason_in("failure", failure[i]);
    samples[i].detail = detail[i];
    samples[i].image_width_px = image_size[2 * i];
    samples[i].image_height_px = image_size[2 * i + 1];
    samples[i].has_mask = has_mask[i] != 0;
  }
  read_bodies(table, samples);
  return samples;
}

manifests::SampleRecord candidate_from_table(const Table& table, std::size_t row) {
  manifests::SampleRecord record;
  record.id = table.texts("id").at(row);
  record.image_ref = table.texts("image_ref").at(row);
  const auto box = table.column<double>("box_xywh_px", 4).subspan(4 * row, 4);
  record.box = {box[0], box[1], box[2], box[3]};
  const auto positions = table.column<double>("keypoints_px", 2 * record.keypoints.size());
  const auto v = table.column<float>("keypoint_v", record.keypoints.size());
  const auto weights = table.column<float>("keypoint_weight", record.keypoints.size());
  for (std::size_t k = 0; k < record.keypoints.size(); ++k) {
    const std::size_t at = row * record.keypoints.size() + k;
    record.keypoints[k] = {positions[2 * at], positions[2 * at + 1], v[at], weights[at]};
  }
  return record;
}

Table to_table(const std::vector<RefinedSample>& samples) {
  Table table;
  table.rows = static_cast<std::int64_t>(samples.size());
  std::vector<std::int64_t> positions;
  positions.reserve(samples.size());
  for (const RefinedSample& sample : samples) positions.push_back(static_cast<std::int64_t>(sample.sample));
  add_curves(table, "curve", samples, &RefinedSample::curve);
  // The column is absent if nothing was held out.
  const bool holds_out = std::any_of(samples.begin(), samples.end(), [](const RefinedSample& sample) {
    return !sample.held_out_curve.empty();
  });
  if (holds_out) add_curves(table, "held_out_curve", samples, &RefinedSample::held_out_curve);
  table.add<std::int64_t>("sample", {}, positions);
  add_bodies(table, samples);
  return table;
}

std::vector<RefinedSample> refined_from_table(const Table& table) {
  std::vector<RefinedSample> samples(static_cast<std::size_t>(table.rows));
  if (samples.empty()) return samples;
  const auto positions = table.column<std::int64_t>("sample", 1);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].sample = static_cast<std::size_t>(positions[i]);
  }
  if (table.blobs.count("curve") == 0) throw std::runtime_error("blob column curve is missing");
  read_curves(table, "curve", samples, &RefinedSample::curve);
  read_curves(table, "held_out_curve", samples, &RefinedSample::held_out_curve);
  read_bodies(table, samples);
  return samples;
}

Table to_table(const std::vector<MeasuredLabel>& labels) {
  Table table;
  table.rows = static_cast<std::int64_t>(labels.size());
  std::vector<std::int64_t> positions;
  positions.reserve(labels.size());
  for (const MeasuredLabel& label : labels) positions.push_back(static_cast<std::int64_t>(label.sample));
  table.add<std::int64_t>("sample", {}, positions);
  for (const manifests::TrustColumn& column : measured_columns()) {
    std::vector<double> values;
    values.reserve(labels.size());
    for (const MeasuredLabel& label : labels) values.push_back(label.scores.*column.score);
    table.add<double>(column.name, {}, values);
  }
  return table;
}

std::vector<MeasuredLabel> measured_from_table(const Table& table) {
  std::vector<MeasuredLabel> labels(static_cast<std::size_t>(table.rows));
  const auto positions = table.column<std::int64_t>("sample", 1);
  for (std::size_t i = 0; i < labels.size(); ++i) labels[i].sample = static_cast<std::size_t>(positions[i]);
  for (const manifests::TrustColumn& column : measured_columns()) {
    const auto values = table.column<double>(column.name, 1);
    for (std::size_t i = 0; i < labels.size(); ++i) labels[i].scores.*column.score = values[i];
  }
  return labels;
}

Table to_table(const std::vector<EncodedCrop>& crops) {
  Table table;
  table.rows = static_cast<std::int64_t>(crops.size());
  std::vector<std::int64_t> positions;
  std::vector<std::int32_t> sides;
  std::vector<double> affines;
  auto& pictures = table.blob_views["picture"];
  auto& masks = table.blob_views["mask"];
  for (const EncodedCrop& crop : crops) {
    positions.push_back(static_cast<std::int64_t>(crop.sample));
    sides.push_back(crop.side_px);
    affines.insert(affines.end(), crop.from_image.begin(), crop.from_image.end());
    pictures.emplace_back(crop.picture);
    masks.emplace_back(crop.mask);
  }
  table.add<std::int64_t>("sample", {}, positions);
  table.add<std::int32_t>("side_px", {}, sides);
  table.add<double>("from_image", {2, 3}, affines);
  return table;
}

std::vector<EncodedCrop> crops_from_table(Table table) {
  std::vector<EncodedCrop> crops(static_cast<std::size_t>(table.rows));
  const auto positions = table.column<std::int64_t>("sample", 1);
  const auto sides = table.column<std::int32_t>("side_px", 1);
  const auto affines = table.column<double>("from_image", 6);
  auto& pictures = blob_column(table, "picture");
  auto& masks = blob_column(table, "mask");
  for (std::size_t i = 0; i < crops.size(); ++i) {
    if (positions[i] < 0 || (i > 0 && positions[i] <= positions[i - 1])) {
      throw std::runtime_error(
          fmt::format("column sample, row {}: got {}, expected ascending positions", i, positions[i]));
    }
    crops[i].sample = static_cast<std::size_t>(positions[i]);
    crops[i].picture = std::move(pictures[i]);
    crops[i].mask = std::move(masks[i]);
    crops[i].side_px = sides[i];
    std::copy_n(affines.begin() + static_cast<std::ptrdiff_t>(6 * i), 6, crops[i].from_image.begin());
  }
  return crops;
}

}  // namespace q3d::pipeline::unit
