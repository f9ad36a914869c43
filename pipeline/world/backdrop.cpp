#include "pipeline/world/backdrop.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace q3d::pipeline::world {
namespace {

// Directions along the ground, which index its texture.
struct GroundAxes {
  Eigen::Vector3f across, along;
  explicit GroundAxes(const Eigen::Vector3f& up) {
    across = Eigen::Vector3f::UnitZ().cross(up);
    if (across.norm() < 1e-3F) across = Eigen::Vector3f::UnitX();
    across.normalize();
    along = up.cross(across);
  }
};

struct Painter {
  const Backdrop& backdrop;
  const PictureCamera& camera;
  const Ground& ground;
  const NoiseField& noise;
  manifests::Rng& rng;
  float subject_distance;  // focus distance of the lens
  cv::Mat picture;         // BGR, 8 bit
  cv::Mat1f distance;      // along the ray to the ground; -1 where there is none
  float shift_x, shift_y;  // position of this picture in the noise field

  Colour ground_colour(float x, float y, float texel) const;
  Colour far_colour(int column, int row, float above) const;
  void paint_far_and_ground();
  void soften_distance();
  void paint_blades();
};

cv::Vec3b pixel(const Colour& colour) {
  const Colour scaled = colour.max(0.0F).min(1.0F) * 255.0F + 0.5F;
  return {static_cast<std::uint8_t>(scaled[2]), static_cast<std::uint8_t>(scaled[1]),
          static_cast<std::uint8_t>(scaled[0])};
}

// Returns the colour at x, y (SMAL units along the ground). texel is the size of a pixel there; finer detail
// is left out.
Colour Painter::ground_colour(float x, float y, float texel) const {
  const float scale = backdrop.ground_scale;
  const float patches = noise.octaves(0.35F * scale * x + shift_x, 0.35F * scale * y + shift_y, 2);
  const float grain = noise.octaves(6.0F * scale * x + shift_y, 6.0F * scale * y + shift_x, 2) *
                      (1.0F - smooth_step(0.02F, 0.3F, texel * scale));
  Colour colour = blend(backdrop.ground_dark, backdrop.ground_light, 0.5F + 0.45F * patches + 0.45F * grain);
  const float fleck = noise.at(11.0F * scale * x - shift_x, 11.0F * scale * y + shift_y);
  if (fleck > 0.55F && texel * scale < 0.15F) colour = blend(colour, backdrop.ground_fleck, 0.7F);
  if (backdrop.place == Place::room && std::abs(x * 2.0F - std::round(x * 2.0F)) < 0.03F) {
    colour *= 0.8F;  // joints between boards
  }
  return colour;
}

// Returns the colour above the ground's edge: the sky, or the things on the horizon in front of it.
Colour Painter::far_colour(int column, int row, float above) const {
  const auto height = static_cast<float>(picture.rows);
  const float x = 6.0F * static_cast<float>(column) / height, y = 6.0F * static_cast<float>(row) / height;
  if (backdrop.place == Place::studio || backdrop.place == Place::room) {
    const float glow = 0.06F * noise.octaves(0.4F * x + shift_x, 0.4F * y + shift_y, 2);
    return blend(backdrop.sky_low, backdrop.sky_high, std::clamp(above, 0.0F, 1.0F)) * (1.0F + glow);
  }
  const float skyline = backdrop.far_height * (1.0F + 0.5F * noise.octaves(0.7F * x + shift_x, shift_y, 3));
  if (above > skyline) {
    const float cloud = smooth_step(0.1F, 0.8F, noise.octaves(0.5F * x + shift_y, y + shift_x, 3));
    return blend(blend(backdrop.sky_low, backdrop.sky_high, std::clamp(1.5F * above, 0.0F, 1.0F)),
                 rgb(240, 242, 245), 0.5F * cloud);
  }
  const float leaves = noise.octaves(3.0F * x + shift_x, 3.0F * y - shift_y, 4);
  const float masses = noise.octaves(0.8F * x - shift_y, 0.8F * y + shift_x, 2);
  const Colour near = blend(backdrop.far_dark, backdrop.far_light, 0.45F + 0.55F * leaves + 0.4F * masses);
  const float haze = backdrop.far_height < 0.5F ? 0.35F : 0.05F;
  return blend(near, backdrop.sky_low, haze);
}

void Painter::paint_far_and_ground() {
  const GroundAxes axes(ground.up);
  // The sky's gradient starts at the row where the ground ends, which is the horizon at the picture's middle
  // column.
  const double slope = ground.up.y() == 0.0F ? 0.0 : -ground.up.z() / ground.up.y();
  const double horizon = camera.centre_y_px + camera.focal_px * slope;
  for (int row = 0; row < picture.rows; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < picture.cols; ++column) {
      const Eigen::Vector3f ray = camera.ray(column, row);
      const float t = ground.hit(ray);
      const bool on_ground = t > 0.0F && t < 400.0F;
      distance(row, column) = on_ground ? t : -1.0F;
      if (on_ground) {
        const Eigen::Vector3f point = t * ray;
        const float texel = t / static_cast<float>(camera.focal_px) / std::max(0.05F, -ground.up.dot(ray));
        out[column] = pixel(ground_colour(axes.across.dot(point), axes.along.dot(point), texel));
      } else {
        const auto above = static_cast<float>((horizon - row) / picture.rows);
        out[column] = pixel(far_colour(column, row, above));
      }
    }
  }
}

// Blurs everything that is nearer or farther than the animal, on which the lens is focused. The sky and the
// horizon blur most.
void Painter::soften_distance() {
  const double sigma = backdrop.defocus * picture.rows;
  if (sigma < 0.4) return;
  cv::Mat soft;
  cv::GaussianBlur(picture, soft, {}, sigma);
  for (int row = 0; row < picture.rows; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    const auto* blurred = soft.ptr<cv::Vec3b>(row);
    for (int column = 0; column < picture.cols; ++column) {
      const float t = distance(row, column);
      const float away = t > 0.0F ? std::abs(1.0F - subject_distance / t) : 1.0F;
      const int weight = static_cast<int>(256.0F * std::min(1.0F, 2.5F * away));
      for (int channel = 0; channel < 3; ++channel) {
        out[column][channel] = static_cast<std::uint8_t>(
            (out[column][channel] * (256 - weight) + blurred[column][channel] * weight) >> 8);
      }
    }
  }
}

void Painter::paint_blades() {
  const int count = static_cast<int>(backdrop.blades * static_cast<float>(picture.total()) / 1000.0F);
  for (int i = 0; i < count; ++i) {
    const int column = rng.below(picture.cols), row = rng.below(picture.rows);
    const float t = distance(row, column);
    if (t <= 0.0F) continue;
    const double length_px = backdrop.blade_length * camera.focal_px / t * rng.uniform(0.4, 1.3);
    if (length_px < 1.5) continue;
    const Colour colour = blend(backdrop.blade_dark, backdrop.blade_light, static_cast<float>(rng.uniform()));
    paint_blade(picture, cv::Point2d(column, row), length_px, colour, rng);
  }
}

}  // namespace

cv::Scalar to_bgr(const Colour& colour) {
  const Colour scaled = colour.max(0.0F).min(1.0F) * 255.0F;
  return {scaled[2], scaled[1], scaled[0]};
}

void paint_blade(cv::Mat& picture, cv::Point2d foot_px, double length_px, const Colour& colour,
                 manifests::Rng& rng) {
  constexpr int kShift = 4;  // sixteenths of a pixel
  const double lean = rng.normal(0.0, 0.35);
  const cv::Point2d tip = foot_px + cv::Point2d(lean, -1.0) * length_px;
  const auto fixed = [](const cv::Point2d& p) {
    return cv::Point(static_cast<int>(std::lround(p.x * 16.0)), static_cast<int>(std::lround(p.y * 16.0)));
  };
  cv::line(picture, fixed(foot_px), fixed(tip), to_bgr(colour), 1, cv::LINE_AA, kShift);
}

cv::Mat paint_backdrop(const Backdrop& backdrop, cv::Size size_px, const PictureCamera& camera,
                       const Ground& ground, float subject_distance, const NoiseField& noise,
                       manifests::Rng& rng) {
  Painter painter{backdrop,
                  camera,
                  ground,
                  noise,
                  rng,
                  subject_distance,
                  cv::Mat(size_px, CV_8UC3),
                  cv::Mat1f(size_px),
                  static_cast<float>(rng.uniform(0.0, 256.0)),
                  static_cast<float>(rng.uniform(0.0, 256.0))};
  painter.paint_far_and_ground();
  for (int i = 0; i < backdrop.things; ++i) {
    paint_thing(painter.picture, backdrop, camera, ground, subject_distance, rng);
  }
  painter.soften_distance();
  painter.paint_blades();
  return painter.picture;
}

}  // namespace q3d::pipeline::world
