#include "pipeline/prediction/predictions_file.h"

#include <algorithm>

#include "loaders/pictures/crop.h"
#include "smal/camera.h"

namespace q3d::pipeline::prediction {
namespace {

using nlohmann::ordered_json;

// Returns the position of a crop's point in the picture. The crop is not rotated, so its axes are the
// picture's.
std::array<double, 2> in_picture(const smal::CropPoint& point, const loaders::pictures::SquareBox& box) {
  return {box.center_x_px + box.side_px * point.x, box.center_y_px + box.side_px * point.y};
}

// Returns the pinhole camera of the whole picture that agrees with the crop's camera inside the crop.
ordered_json camera_json(const loaders::pictures::SquareBox& box) {
  return {{"focal_px", smal::kFocalInCropUnits * box.side_px},
          {"principal_point_px", {box.center_x_px, box.center_y_px}}};
}

ordered_json body_json(const PredictedAnimal& animal) {
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(animal.record.box);
  ordered_json points = ordered_json::array();
  for (const smal::CropPoint& point : animal.body.keypoints_2d) points.push_back(in_picture(point, box));
  return {{"pose", animal.body.pose},
          {"betas", animal.body.betas},
          {"translation", animal.body.translation},
          {"camera", camera_json(box)},
          {"keypoints_2d_px", std::move(points)},
          {"keypoints_3d", animal.body.keypoints_3d}};
}

ordered_json adaptation_json(const PredictedAnimal& animal) {
  if (animal.curve.empty()) return nullptr;
  return {{"iterations", animal.curve.size() - 1},
          {"kept_iterate", animal.best_iteration},
          {"l_proj_before", animal.curve.front()},
          {"l_proj_after", animal.curve[static_cast<std::size_t>(animal.best_iteration)]}};
}

ordered_json animal_json(const PredictedAnimal& animal) {
  const manifests::SampleRecord& record = animal.record;
  ordered_json entry{{"id", record.id}, {"picture", record.image_ref}};
  if (animal.failure != manifests::Reason::none) {
    entry["failure"] = to_string(animal.failure);
    entry["detail"] = animal.detail;
    return entry;
  }
  entry["picture_size_px"] = {animal.image_width_px, animal.image_height_px};
  entry["box_xywh_px"] = {record.box.x_px, record.box.y_px, record.box.w_px, record.box.h_px};
  entry["species"] = record.species;
  entry["body"] = body_json(animal);
  entry["adaptation"] = adaptation_json(animal);
  return entry;
}

}  // namespace

ordered_json predictions_document(const PredictionSummary& summary) {
  ordered_json animals = ordered_json::array();
  for (const PredictedAnimal& animal : summary.animals) animals.push_back(animal_json(animal));
  return {{"schema", kPredictionsSchema},
          {"checkpoint_sha256", summary.checkpoint_sha256},
          {"smal_asset_sha256", summary.smal_asset_sha256},
          {"notes", summary.notes},
          {"animals", std::move(animals)}};
}

}  // namespace q3d::pipeline::prediction
