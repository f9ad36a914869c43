#include "pipeline/world/annotations.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "pipeline/world/superanimal_source.h"

namespace q3d::pipeline::world {
namespace {

using nlohmann::json;

// Converts a float to its shortest decimal, so that 0.3F is written as 0.3 and reads back as the same float.
double decimal(float value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  double result = 0.0;
  std::from_chars(text, end, result);
  return result;
}

double rounded(double value, double step) {
  return std::round(value / step) * step;
}
double hundredth(double px) {
  return std::round(px * 100.0) / 100.0;
}  // what annotation tools store

template <typename Range>
json decimals(const Range& values) {
  json result = json::array();
  for (const float value : values) result.push_back(decimal(value));
  return result;
}

json vector3(const Eigen::Vector3f& p) {
  return {decimal(p.x()), decimal(p.y()), decimal(p.z())};
}

json points3(std::span<const Eigen::Vector3f> points) {
  json result = json::array();
  for (const Eigen::Vector3f& point : points) result.push_back(vector3(point));
  return result;
}

json exact_points(std::span<const SeenLandmark> points) {
  json result = json::array();
  for (const SeenLandmark& p : points) {
    result.push_back({rounded(p.px.x(), 1e-4), rounded(p.px.y(), 1e-4), p.inside ? 1 : 0});
  }
  return result;
}

const Species& species_of(const FinishedPicture& picture) {
  return species_table()[static_cast<std::size_t>(picture.plan.species)];
}

json xywh(const cv::Rect& box) {
  return {box.x, box.y, box.width, box.height};
}

// Returns the smallest box around the labelled points; empty if there are none.
cv::Rect2d around(std::span<const Label> labels) {
  double left = 1e9, top = 1e9, right = -1e9, bottom = -1e9;
  for (const Label& label : labels) {
    if (!label.given) continue;
    left = std::min(left, label.x_px);
    right = std::max(right, label.x_px);
    top = std::min(top, label.y_px);
    bottom = std::max(bottom, label.y_px);
  }
  return right < left ? cv::Rect2d() : cv::Rect2d(left, top, right - left, bottom - top);
}

}  // namespace

json prima_annotations(std::span<const FinishedPicture> pictures, const std::string& info) {
  json data = json::array();
  for (const FinishedPicture& picture : pictures) {
    const PictureTruth& truth = picture.truth;
    json keypoints = json::array();
    for (const Label& label : truth.labels) {
      keypoints.push_back(label.given ? json{hundredth(label.x_px), hundredth(label.y_px), 1.0}
                                      : json{0.0, 0.0, 0.0});
    }
    const auto betas = std::span(truth.posture.betas);
    const std::string folder = std::string(domain_of(picture.plan.set).folder) + "/";
    data.push_back({{"img_path", picture.plan.listed},
                    {"mask_path", picture.plan.mask.substr(folder.size())},
                    {"bbox", xywh(truth.framing.box)},
                    {"keypoint_2d", std::move(keypoints)},
                    {"reproj_kp_2d", exact_points(truth.keypoints)},
                    {"keypoint_3d", points3(truth.keypoints_3d)},
                    {"pose", decimals(truth.posture.pose)},
                    {"shape", decimals(betas.first(20))},
                    {"shape_extra", decimals(betas.subspan(20))},
                    {"trans", vector3(truth.framing.translation)},
                    {"supercategory", static_cast<int>(species_of(picture).family)},
                    {"category", picture.plan.species},
                    {"height", truth.size_px.height},
                    {"width", truth.size_px.width}});
  }
  return {{"info", info}, {"data", std::move(data)}};
}

json superanimal_annotations(std::span<const FinishedPicture> pictures,
                             const std::vector<Landmark>& landmarks) {
  json images = json::array(), annotations = json::array(), names = json::array();
  for (const Landmark& landmark : landmarks) names.push_back(landmark.name);
  for (const FinishedPicture& picture : pictures) {
    const SuperAnimalSource& source = superanimal_sources()[static_cast<std::size_t>(picture.plan.source)];
    const PictureTruth& truth = picture.truth;
    std::vector<Label> labels = truth.labels;
    json keypoints = json::array();
    for (std::size_t i = 0; i < labels.size(); ++i) {
      const bool covered =
          std::find(source.covers.begin(), source.covers.end(), static_cast<int>(i)) != source.covers.end();
      labels[i].given = labels[i].given && covered;
      // SuperAnimal's converter turns a labelled point with a negative coordinate into a missing one.
      if (labels[i].given && labels[i].x_px >= 0.0 && labels[i].y_px >= 0.0) {
        for (const double value : {hundredth(labels[i].x_px), hundredth(labels[i].y_px)})
          keypoints.push_back(value);
        keypoints.push_back(source.labelled_v);
      } else {
        const int code = covered && source.missing_is_zero ? 0 : -1;
        for (int value = 0; value < 3; ++value) keypoints.push_back(code);
      }
    }
    json box = xywh(truth.framing.box);
    const cv::Rect2d tight = around(labels);
    if (source.keypoint_box && tight.width > 0.0) {
      constexpr double kMargin = 20.0;  // cut at 0, but not at the picture's right and bottom
      const double x = std::max(0.0, tight.x - kMargin), y = std::max(0.0, tight.y - kMargin);
      box = {hundredth(x), hundredth(y), hundredth(tight.x + tight.width + kMargin - x),
             hundredth(tight.y + tight.height + kMargin - y)};
    }
    const double area = box[2].get<double>() * box[3].get<double>();
    images.push_back({{"id", picture.plan.image_id},
                      {"file_name", picture.plan.listed},
                      {"width", truth.size_px.width},
                      {"height", truth.size_px.height},
                      {"source_dataset", source.name}});
    annotations.push_back({{"id", annotations.size()},
                           {"image_id", picture.plan.image_id},
                           {"category_id", 1},
                           {"bbox", std::move(box)},
                           {"area", area},
                           {"iscrowd", 0},
                           {"num_keypoints", names.size()},  // always the number of all keypoints
                           {"keypoints", std::move(keypoints)}});
  }
  return {{"images", std::move(images)},
          {"annotations", std::move(annotations)},
          {"categories",
           {{{"id", 1},
             {"name", "superquadruped"},
             {"supercategory", "animal"},
             {"keypoints", std::move(names)},
             {"skeleton", json::array()}}}}};
}

json animal_kingdom_annotations(std::span<const FinishedPicture> pictures) {
  json list = json::array();
  for (const FinishedPicture& picture : pictures) {
    const Species& species = species_of(picture);
    json joints = json::array(), visible = json::array();
    for (const Label& label : picture.truth.labels) {
      visible.push_back(label.given ? 1 : 0);
      joints.push_back(label.given ? json{label.x_px, label.y_px} : json{-1.0, -1.0});
    }
    cv::Rect2d box = around(picture.truth.labels);
    if (box.empty()) box = picture.truth.framing.box;
    list.push_back({{"image", picture.plan.listed},
                    {"animal", species.kingdom_name},
                    {"animal_parent_class", "Mammal"},
                    {"animal_class", "Mammal"},
                    {"animal_subclass", species.kingdom_group},
                    {"joints_vis", std::move(visible)},
                    {"joints", std::move(joints)},
                    {"scale", std::max(box.width, box.height) / 200.0},
                    {"center", {box.x + 0.5 * box.width, box.y + 0.5 * box.height}},
                    {"Protocol 3 mammal", "test"}});
  }
  return list;
}

json truth_annotations(std::span<const FinishedPicture> pictures) {
  json all = json::object();
  for (const FinishedPicture& picture : pictures) {
    const PictureTruth& truth = picture.truth;
    const PictureCamera& camera = truth.framing.camera;
    all[picture.plan.listed] = {
        {"species", species_of(picture).name},
        {"family", static_cast<int>(species_of(picture).family)},
        {"pose", decimals(truth.posture.pose)},
        {"betas", decimals(truth.posture.betas)},
        {"trans", vector3(truth.framing.translation)},
        {"camera", {{"focal_px", camera.focal_px}, {"center_px", {camera.centre_x_px, camera.centre_y_px}}}},
        {"bbox", xywh(truth.framing.box)},
        {"keypoint_2d", exact_points(truth.keypoints)},
        {"keypoint_3d", points3(truth.keypoints_3d)},
        {"mask_path", picture.plan.mask}};
  }
  return {{"pictures", std::move(all)}};
}

}  // namespace q3d::pipeline::world
