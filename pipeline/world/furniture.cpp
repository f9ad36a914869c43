// Draws the things that stand behind the animal.
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pipeline/world/backdrop.h"

namespace q3d::pipeline::world {
namespace {

struct Spot {
  cv::Point2d foot_px;
  double unit_px;  // pixels of one SMAL unit there
};

// Returns a random place on the ground behind the animal. The depth is drawn, and the height follows from the
// plane.
Spot spot_behind(const cv::Mat& picture, const PictureCamera& camera, const Ground& ground,
                 float subject_distance, manifests::Rng& rng) {
  const double column = rng.uniform(-0.05, 1.05) * picture.cols;
  const double depth = subject_distance * std::exp(rng.uniform(0.15, 1.4));
  const double x = (column - camera.centre_x_px) / camera.focal_px * depth;
  const double y = (ground.level - ground.up.x() * x - ground.up.z() * depth) / ground.up.y();
  return {{column, camera.centre_y_px + camera.focal_px * y / depth}, camera.focal_px / depth};
}

void paint_trunk(cv::Mat& picture, const Spot& spot, const Backdrop& backdrop, manifests::Rng& rng) {
  const double width = spot.unit_px * rng.uniform(0.08, 0.4);
  const double lean = rng.normal(0.0, 0.08) * picture.rows;
  const Colour bark = blend(rgb(52, 42, 34), rgb(128, 112, 92), static_cast<float>(rng.uniform()));
  const double top = -0.1 * picture.rows;
  constexpr int kStrips = 6;  // lit from one side
  const bool lit_left = rng.chance(0.5);
  for (int strip = 0; strip < kStrips; ++strip) {
    const double left = spot.foot_px.x + width * (static_cast<double>(strip) / kStrips - 0.5);
    const double step = width / kStrips + 1.0;
    const float light = 0.6F + 0.5F * static_cast<float>(lit_left ? kStrips - strip : strip + 1) / kStrips;
    const std::vector<cv::Point> quad{{static_cast<int>(left), static_cast<int>(spot.foot_px.y)},
                                      {static_cast<int>(left + step), static_cast<int>(spot.foot_px.y)},
                                      {static_cast<int>(left + step + lean), static_cast<int>(top)},
                                      {static_cast<int>(left + lean), static_cast<int>(top)}};
    const Colour colour =
        blend(bark, backdrop.far_dark, 0.25F) * light * static_cast<float>(rng.uniform(0.9, 1.1));
    cv::fillConvexPoly(picture, quad, to_bgr(colour), cv::LINE_AA);
  }
}

void paint_bush(cv::Mat& picture, const Spot& spot, const Backdrop& backdrop, manifests::Rng& rng) {
  const double radius = spot.unit_px * rng.uniform(0.25, 0.9);
  for (int leaf = 0; leaf < 70; ++leaf) {
    const double angle = rng.uniform(0.0, 2.0 * CV_PI), reach = radius * std::sqrt(rng.uniform());
    const cv::Point centre(static_cast<int>(spot.foot_px.x + reach * std::cos(angle)),
                           static_cast<int>(spot.foot_px.y - 0.6 * radius + 0.7 * reach * std::sin(angle)));
    const auto light = static_cast<float>(
        std::clamp(0.25 + 0.25 * leaf / 70.0 - 0.4 * std::sin(angle) * reach / radius + rng.normal(0.0, 0.12),
                   0.0, 1.0));
    const Colour colour = blend(backdrop.blade_dark * 0.6F, backdrop.blade_light, light);
    cv::circle(picture, centre, std::max(1, static_cast<int>(radius * rng.uniform(0.06, 0.2))),
               to_bgr(colour), cv::FILLED, cv::LINE_AA);
  }
}

void paint_stone(cv::Mat& picture, const Spot& spot, manifests::Rng& rng) {
  const double width = spot.unit_px * rng.uniform(0.15, 0.8), height = width * rng.uniform(0.35, 0.8);
  const Colour stone = blend(rgb(92, 86, 80), rgb(176, 170, 160), static_cast<float>(rng.uniform()));
  std::vector<cv::Point> outline;
  for (int corner = 0; corner < 11; ++corner) {
    const double angle = CV_PI * corner / 10.0, bump = rng.uniform(0.85, 1.1);
    outline.emplace_back(static_cast<int>(spot.foot_px.x + 0.5 * width * bump * std::cos(angle)),
                         static_cast<int>(spot.foot_px.y - height * bump * std::sin(angle)));
  }
  cv::fillPoly(picture, std::vector<std::vector<cv::Point>>{outline}, to_bgr(stone * 0.7F), cv::LINE_AA);
  for (cv::Point& corner : outline) {  // the lit upper part
    corner.x = static_cast<int>(spot.foot_px.x + 0.75 * (corner.x - spot.foot_px.x));
    corner.y = static_cast<int>(spot.foot_px.y - 0.35 * height + 0.6 * (corner.y - spot.foot_px.y));
  }
  cv::fillPoly(picture, std::vector<std::vector<cv::Point>>{outline}, to_bgr(stone), cv::LINE_AA);
}

void paint_fence(cv::Mat& picture, const Spot& spot, manifests::Rng& rng) {
  const Colour wood = blend(rgb(88, 70, 54), rgb(226, 224, 218), static_cast<float>(rng.uniform()));
  const double height = 0.7 * spot.unit_px, gap = spot.unit_px * rng.uniform(0.5, 1.2);
  const int thick = std::max(1, static_cast<int>(0.05 * spot.unit_px));
  const int rails = 2 + rng.below(2);
  for (int rail = 0; rail < rails; ++rail) {
    const int y = static_cast<int>(spot.foot_px.y - height * (0.95 - 0.35 * rail));
    cv::line(picture, {0, y}, {picture.cols, y}, to_bgr(wood * 0.9F), thick, cv::LINE_AA);
  }
  for (double x = std::fmod(spot.foot_px.x, gap); x < picture.cols; x += gap) {
    cv::line(picture, {static_cast<int>(x), static_cast<int>(spot.foot_px.y)},
             {static_cast<int>(x), static_cast<int>(spot.foot_px.y - height)}, to_bgr(wood), thick + 1,
             cv::LINE_AA);
  }
}

void paint_cupboard(cv::Mat& picture, const Spot& spot, const Backdrop& backdrop, manifests::Rng& rng) {
  const double width = spot.unit_px * rng.uniform(0.4, 1.5), height = spot.unit_px * rng.uniform(0.4, 2.0);
  const Colour cloth(static_cast<float>(rng.uniform(0.1, 0.9)), static_cast<float>(rng.uniform(0.1, 0.8)),
                     static_cast<float>(rng.uniform(0.1, 0.8)));
  const Colour front = rng.chance(0.5) ? blend(backdrop.far_dark, backdrop.far_light, 0.5F) : cloth;
  const cv::Rect body(static_cast<int>(spot.foot_px.x - 0.5 * width),
                      static_cast<int>(spot.foot_px.y - height), static_cast<int>(width),
                      static_cast<int>(height));
  cv::rectangle(picture, body, to_bgr(front), cv::FILLED);
  cv::rectangle(picture, body, to_bgr(front * 0.6F), 2, cv::LINE_AA);
}

}  // namespace

void paint_thing(cv::Mat& picture, const Backdrop& backdrop, const PictureCamera& camera,
                 const Ground& ground, float subject_distance, manifests::Rng& rng) {
  const Spot spot = spot_behind(picture, camera, ground, subject_distance, rng);
  switch (backdrop.place) {
    case Place::forest:
      return rng.chance(0.65) ? paint_trunk(picture, spot, backdrop, rng)
                              : paint_bush(picture, spot, backdrop, rng);
    case Place::meadow:
    case Place::savanna:
      return rng.chance(0.2)   ? paint_trunk(picture, spot, backdrop, rng)
             : rng.chance(0.7) ? paint_bush(picture, spot, backdrop, rng)
                               : paint_stone(picture, spot, rng);
    case Place::snow:
      return rng.chance(0.5) ? paint_trunk(picture, spot, backdrop, rng) : paint_stone(picture, spot, rng);
    case Place::desert:
    case Place::rocks:
      return rng.chance(0.25) ? paint_bush(picture, spot, backdrop, rng) : paint_stone(picture, spot, rng);
    case Place::yard:
      return rng.chance(0.7) ? paint_fence(picture, spot, rng) : paint_bush(picture, spot, backdrop, rng);
    case Place::room:
      return paint_cupboard(picture, spot, backdrop, rng);
    case Place::studio:
      return;
  }
}

}  // namespace q3d::pipeline::world
