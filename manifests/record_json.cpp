#include "manifests/record_json.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace q3d::manifests {
namespace {

using nlohmann::json;

json number(double value) {
  if (std::isfinite(value)) return value;
  if (std::isnan(value)) return "nan";
  return value > 0 ? "inf" : "-inf";
}

double number(const json& value) {
  if (value.is_number()) return value.get<double>();
  const auto& text = value.get_ref<const std::string&>();
  if (text == "nan") return std::numeric_limits<double>::quiet_NaN();
  if (text == "inf") return std::numeric_limits<double>::infinity();
  if (text == "-inf") return -std::numeric_limits<double>::infinity();
  throw std::runtime_error(fmt::format("\"{}\" is not a number", text));
}

template <typename T, std::size_t N>
json numbers(const std::array<T, N>& values) {
  json array = json::array();
  for (const T value : values) array.push_back(number(value));
  return array;
}

template <typename T, std::size_t N>
void read_numbers(const json& array, std::array<T, N>& values) {
  if (!array.is_array() || array.size() != values.size()) {
    throw std::runtime_error(fmt::format("got {}, expected {} numbers", array.dump(), values.size()));
  }
  for (std::size_t i = 0; i < N; ++i) values[i] = static_cast<T>(number(array[i]));
}

json box_json(const Box& box) {
  return {number(box.x_px), number(box.y_px), number(box.w_px), number(box.h_px)};
}

Box read_box(const json& array) {
  std::array<double, 4> xywh{};
  read_numbers(array, xywh);
  return {xywh[0], xywh[1], xywh[2], xywh[3]};
}

json keypoints_json(const Keypoints& keypoints) {
  json array = json::array();
  for (const Keypoint& k : keypoints) {
    array.push_back({number(k.x_px), number(k.y_px), number(k.v), number(k.weight)});
  }
  return array;
}

Keypoints read_keypoints(const json& array) {
  Keypoints keypoints;
  if (!array.is_array() || array.size() != keypoints.size()) {
    throw std::runtime_error(fmt::format("got {}, expected {} keypoints", array.dump(), keypoints.size()));
  }
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    std::array<double, 4> row{};
    read_numbers(array[i], row);
    keypoints[i] = {row[0], row[1], static_cast<float>(row[2]), static_cast<float>(row[3])};
  }
  return keypoints;
}

json truth_json(const BodyTruth& truth) {
  return {{"has_pose", truth.has_pose},
          {"has_betas", truth.has_betas},
          {"has_keypoints_3d", truth.has_keypoints_3d},
          {"pose_axis_angle", numbers(truth.pose_axis_angle)},
          {"betas", numbers(truth.betas)},
          {"trans", numbers(truth.trans)},
          {"keypoints_3d", numbers(truth.keypoints_3d)}};
}

BodyTruth read_truth(const json& object) {
  BodyTruth truth;
  object.at("has_pose").get_to(truth.has_pose);
  object.at("has_betas").get_to(truth.has_betas);
  object.at("has_keypoints_3d").get_to(truth.has_keypoints_3d);
  read_numbers(object.at("pose_axis_angle"), truth.pose_axis_angle);
  read_numbers(object.at("betas"), truth.betas);
  read_numbers(object.at("trans"), truth.trans);
  read_numbers(object.at("keypoints_3d"), truth.keypoints_3d);
  return truth;
}

}  // namespace

void to_json(json& object, const SampleRecord& record) {
  object = {{"id", record.id},
            {"dataset", record.dataset},
            {"split", record.split},
            {"source", record.source},
            {"species", record.species},
            {"family", to_string(record.family)},
            {"image_path", record.image_path},
            {"image_ref", record.image_ref},
            {"mask_path", record.mask_path},
            {"width_px", record.width_px},
            {"height_px", record.height_px},
            {"box_xywh_px", box_json(record.box)},
            {"keypoints", keypoints_json(record.keypoints)},
            {"failure", to_string(record.failure)},
            {"failure_detail", record.failure_detail}};
  if (record.orientation != 1) object["orientation"] = record.orientation;
  if (record.scale != 1.0) object["scale"] = number(record.scale);
  if (record.truth) object["truth"] = truth_json(*record.truth);
}

void from_json(const json& object, SampleRecord& record) {
  SampleRecord read;
  std::string member;
  const auto at = [&](const char* name) -> const json& {
    member = name;
    return object.at(name);
  };
  try {
    at("id").get_to(read.id);
    at("dataset").get_to(read.dataset);
    at("split").get_to(read.split);
    at("source").get_to(read.source);
    at("species").get_to(read.species);
    read.family = family_from_string(at("family").get_ref<const std::string&>());
    at("image_path").get_to(read.image_path);
    at("image_ref").get_to(read.image_ref);
    at("mask_path").get_to(read.mask_path);
    at("width_px").get_to(read.width_px);
    at("height_px").get_to(read.height_px);
    read.box = read_box(at("box_xywh_px"));
    read.keypoints = read_keypoints(at("keypoints"));
    read.failure = reason_from_string(at("failure").get_ref<const std::string&>());
    at("failure_detail").get_to(read.failure_detail);
    if (object.contains("orientation")) at("orientation").get_to(read.orientation);
    if (object.contains("scale")) read.scale = number(at("scale"));
    if (object.contains("truth")) read.truth = read_truth(at("truth"));
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("sample record \"{}\", member \"{}\": {}", read.id, member, error.what()));
  }
  record = std::move(read);
}

}  // namespace q3d::manifests
