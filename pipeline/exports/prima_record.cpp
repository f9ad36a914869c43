#include <span>

#include "pipeline/exports/records.h"
#include "smal/axis_angle.h"

namespace q3d::pipeline::exports {
namespace {

using nlohmann::ordered_json;

constexpr std::ptrdiff_t kFirstBetas = 20;  // `shape`; the other 21 are `shape_extra`

ordered_json numbers(std::span<const float> values) {
  ordered_json list = ordered_json::array();
  for (const float value : values) list.push_back(double{value});
  return list;
}

ordered_json rows(std::span<const float> values, std::size_t width) {
  ordered_json list = ordered_json::array();
  for (std::size_t at = 0; at < values.size(); at += width) {
    list.push_back(numbers(values.subspan(at, width)));
  }
  return list;
}

// Returns the pose. A body of the annotation file keeps the file's own numbers, because a conversion from
// matrices would round them.
ordered_json pose_of(const manifests::ShardSample& sample) {
  if (sample.label_kind == manifests::LabelKind::truth) {
    return numbers(sample.record.truth.value().pose_axis_angle);
  }
  return smal::axis_angles(sample.body.pose);
}

ordered_json keypoints_2d(const manifests::ShardSample& sample, const ExportedPicture& picture) {
  ordered_json list = ordered_json::array();
  for (const manifests::Keypoint& keypoint : sample.record.keypoints) {
    if (!(keypoint.weight > 0.0F)) {
      list.push_back({0.0, 0.0, 0.0});
      continue;
    }
    const auto at = loaders::pictures::map_point(picture.from_image, {keypoint.x_px, keypoint.y_px});
    list.push_back({at.x, at.y, double{keypoint.v}});
  }
  return list;
}

}  // namespace

ordered_json prima_record(const manifests::ShardSample& sample, const ExportedPicture& picture,
                          const PictureNames& names) {
  const manifests::Box box = exported_box(sample, picture);
  ordered_json record = {{"img_path", names.image}};
  if (!names.mask.empty()) record["mask_path"] = names.mask;
  record["bbox"] = {box.x_px, box.y_px, box.w_px, box.h_px};
  record["keypoint_2d"] = keypoints_2d(sample, picture);
  if (sample.has_keypoints_3d) record["keypoint_3d"] = rows(sample.keypoints_3d, 3);
  if (sample.has_pose) {
    record["pose"] = pose_of(sample);
    record["trans"] = numbers(sample.body.translation);
  }
  if (sample.has_betas) {
    const std::span<const float> betas(sample.body.betas);
    record["shape"] = numbers(betas.first(kFirstBetas));
    record["shape_extra"] = numbers(betas.subspan(kFirstBetas));
  }
  record["supercategory"] = static_cast<int>(sample.record.family);
  record["height"] = picture.height_px;
  record["width"] = picture.width_px;
  record["id"] = sample.record.id;
  record["label_kind"] = manifests::to_string(sample.label_kind);
  return record;
}

}  // namespace q3d::pipeline::exports
