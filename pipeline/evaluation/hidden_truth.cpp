#include "pipeline/evaluation/hidden_truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>

#include "loaders/formats/picture_finder.h"
#include "manifests/atomic_file.h"
#include "manifests/json_parse.h"

namespace q3d::pipeline::evaluation {
namespace {

using nlohmann::json;

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw std::runtime_error(where + ": " + what);
}

const json& field(const json& object, const char* name, const std::string& where) {
  const auto found = object.find(name);
  if (found == object.end()) fail(where, fmt::format("the field \"{}\" is missing", name));
  return *found;
}

void append_numbers(const json& value, const std::string& where, std::vector<double>& numbers) {
  if (value.is_array()) {
    for (const json& element : value) append_numbers(element, where, numbers);
  } else if (value.is_number() && std::isfinite(value.get<double>())) {
    numbers.push_back(value.get<double>());
  } else {
    fail(where, fmt::format("got {}, expected a finite number", value.dump()));
  }
}

// Reads exactly `count` finite numbers, which may be nested or flat.
std::vector<double> numbers(const json& object, const char* name, std::size_t count,
                            const std::string& where) {
  std::vector<double> values;
  append_numbers(field(object, name, where), fmt::format("{}: {}", where, name), values);
  if (values.size() != count) {
    fail(where, fmt::format("{}: got {} numbers, expected {}", name, values.size(), count));
  }
  return values;
}

template <std::size_t N>
void read_floats(const json& object, const char* name, const std::string& where, std::array<float, N>& into) {
  const std::vector<double> values = numbers(object, name, N, where);
  std::transform(values.begin(), values.end(), into.begin(),
                 [](double value) { return static_cast<float>(value); });
}

manifests::Family read_family(const json& object, const std::string& where) {
  const json& value = field(object, "family", where);
  if (!value.is_number_integer() || value.get<double>() < -1 || value.get<double>() > 4) {
    fail(where, fmt::format("family: got {}, expected -1 (none) or 0 to 4", value.dump()));
  }
  return static_cast<manifests::Family>(value.get<int>());
}

manifests::Keypoints read_keypoints(const json& object, const std::string& where) {
  const std::vector<double> values = numbers(object, "keypoint_2d", 3 * manifests::kNumKeypoints, where);
  manifests::Keypoints keypoints{};
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    const double v = values[3 * k + 2];
    keypoints[k] = {values[3 * k], values[3 * k + 1], static_cast<float>(v), v > 0 ? 1.0F : 0.0F};
  }
  return keypoints;
}

PictureTruth read_picture(const json& object, const std::string& where,
                          loaders::formats::PictureFinder* masks) {
  if (!object.is_object()) fail(where, fmt::format("got {}, expected an object", object.type_name()));
  PictureTruth truth;
  const json& species = field(object, "species", where);
  if (!species.is_string()) fail(where, fmt::format("species: got {}, expected a text", species.dump()));
  truth.species = species.get<std::string>();
  truth.family = read_family(object, where);
  truth.body.has_pose = truth.body.has_betas = truth.body.has_keypoints_3d = true;
  read_floats(object, "pose", where, truth.body.pose_axis_angle);
  read_floats(object, "betas", where, truth.body.betas);
  read_floats(object, "trans", where, truth.body.trans);
  read_floats(object, "keypoint_3d", where, truth.body.keypoints_3d);
  truth.keypoints = read_keypoints(object, where);
  if (masks != nullptr && object.contains("mask_path")) {
    const json& name = object.at("mask_path");
    if (!name.is_string()) fail(where, fmt::format("mask_path: got {}, expected a text", name.dump()));
    const loaders::formats::FoundPicture found = masks->find(name.get<std::string>());
    if (found.failure != manifests::Reason::none) {
      fail(where, fmt::format("mask_path: {}, expected a file below the folder of masks", found.got));
    }
    truth.mask_path = found.path.string();
  }
  return truth;
}

}  // namespace

HiddenTruth::HiddenTruth(const std::filesystem::path& file, const std::filesystem::path& masks)
    : file_(file) {
  const json document = manifests::parse_json_or_null<json>(manifests::read_file(file));
  if (!document.is_object() || !document.contains("pictures") || !document["pictures"].is_object()) {
    fail(file.string(), "expected a JSON object with \"pictures\": {<name>: {...}}");
  }
  std::optional<loaders::formats::PictureFinder> finder;
  if (!masks.empty()) finder.emplace(loaders::formats::PictureFolders{.root = masks});
  for (const auto& [name, object] : document["pictures"].items()) {
    pictures_[name] = read_picture(object, file.string() + ": " + name, finder ? &*finder : nullptr);
  }
}

const PictureTruth* HiddenTruth::find(const std::string& listed_name) const {
  const auto found = pictures_.find(listed_name);
  return found == pictures_.end() ? nullptr : &found->second;
}

std::size_t HiddenTruth::complete(std::vector<manifests::SampleRecord>& records) const {
  std::size_t without = 0;
  std::set<std::string> seen;
  for (manifests::SampleRecord& record : records) {
    const PictureTruth* truth = find(record.image_ref);
    if (truth == nullptr) {
      ++without;
      continue;
    }
    if (!seen.insert(record.image_ref).second) {
      fail(file_.string(), fmt::format("the truth of {} describes one animal, and the annotation file has "
                                       "two in that picture (the second is {})",
                                       record.image_ref, record.id));
    }
    record.truth = truth->body;
    record.species = truth->species;
    record.family = truth->family;
    if (!truth->mask_path.empty()) record.mask_path = truth->mask_path;
  }
  return without;
}

}  // namespace q3d::pipeline::evaluation
