#include <array>
#include <cmath>
#include <utility>

#include "loaders/keypoints/topology.h"
#include "pipeline/exports/records.h"

namespace q3d::pipeline::exports {
namespace {

using nlohmann::ordered_json;

// Bones between keypoints, for drawing.
constexpr std::array<std::pair<int, int>, 27> kBones{
    {{24, 0},  {24, 1},  {24, 2},  {2, 22}, {2, 23}, {0, 20},  {1, 21}, {24, 18}, {18, 12},
     {18, 13}, {12, 13}, {12, 8},  {8, 14}, {14, 3}, {13, 9},  {9, 15}, {15, 4},  {12, 7},
     {13, 7},  {7, 10},  {10, 16}, {16, 5}, {7, 11}, {11, 17}, {17, 6}, {7, 25},  {25, 19}}};

// Returns COCO's v: 0 for a point that is not labelled, 1 for a hidden one and 2 for a visible one. A
// confidence does not say whether a point is hidden.
int coco_v(const manifests::Keypoint& keypoint) {
  if (!(keypoint.weight > 0.0F)) return 0;
  return keypoint.v == 1.0F ? 1 : 2;
}

bool is_confidence(const manifests::Keypoint& keypoint) {
  return keypoint.weight > 0.0F && keypoint.v != 1.0F && keypoint.v != 2.0F;
}

ordered_json number_or_null(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json attributes(const manifests::ShardSample& sample) {
  ordered_json object = {{"id", sample.record.id},
                         {"label_kind", manifests::to_string(sample.label_kind)},
                         {"final_error", number_or_null(sample.judgement.final_error)},
                         {"veto", false}};
  ordered_json confidences = ordered_json::object();
  const auto& names = loaders::keypoints::topology("animal3d26").keypoints;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const manifests::Keypoint& keypoint = sample.record.keypoints[k];
    if (is_confidence(keypoint)) confidences[names[k]] = double{keypoint.v};
  }
  if (!confidences.empty()) object["confidences"] = std::move(confidences);
  return object;
}

}  // namespace

ordered_json coco_image(const manifests::ShardSample& sample, const ExportedPicture& picture,
                        const std::string& file_name, std::int64_t id) {
  return {{"id", id},
          {"file_name", file_name},
          {"width", picture.width_px},
          {"height", picture.height_px},
          {"quadruped3d",
           {{"id", sample.record.id},
            {"image_ref", sample.record.image_ref},
            {"picture_from_image", picture.from_image}}}};
}

ordered_json coco_annotation(const manifests::ShardSample& sample, const ExportedPicture& picture,
                             const CocoIds& ids) {
  const manifests::Box box = exported_box(sample, picture);
  ordered_json keypoints = ordered_json::array();
  int labelled = 0;
  for (const manifests::Keypoint& keypoint : sample.record.keypoints) {
    const int v = coco_v(keypoint);
    const auto at = loaders::pictures::map_point(picture.from_image, {keypoint.x_px, keypoint.y_px});
    keypoints.push_back(v > 0 ? at.x : 0.0);
    keypoints.push_back(v > 0 ? at.y : 0.0);
    keypoints.push_back(v);
    labelled += v > 0 ? 1 : 0;
  }
  return {{"id", ids.annotation},
          {"image_id", ids.image},
          {"category_id", ids.category},
          {"bbox", {box.x_px, box.y_px, box.w_px, box.h_px}},
          {"area", box.w_px * box.h_px},
          {"iscrowd", 0},
          {"num_keypoints", labelled},
          {"keypoints", std::move(keypoints)},
          {"attributes", attributes(sample)}};
}

ordered_json coco_category(const std::string& species, manifests::Family family, std::int64_t id) {
  ordered_json bones = ordered_json::array();
  for (const auto& [first, second] : kBones) bones.push_back({first + 1, second + 1});  // COCO counts from 1
  return {{"id", id},
          {"name", species.empty() ? "animal" : species},
          {"supercategory", family == manifests::Family::none ? "animal" : manifests::to_string(family)},
          {"keypoints", loaders::keypoints::topology("animal3d26").keypoints},
          {"skeleton", std::move(bones)}};
}

}  // namespace q3d::pipeline::exports
