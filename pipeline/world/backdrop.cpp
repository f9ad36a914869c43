#include "pipeline/world/backdrop.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace q3d::pipeline::world {
namespace {

// Directions along the ground, so that its texture can be indexed.
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
  Rng& rng;
  cv::Mat picture;       // BGR, 8 bit
  cv::Mat1f distance;    // along the ray to the ground; -1 where there is none
  float shift_x, shift_y;  // this picture's place in the noise field

  Colour ground_colour(float x, float y, float texel) const;
  Colour far_colour(int column, int row, float above, const Eigen::Vector3f& ray) const;
  void paint_far_and_ground();
  void paint_thing();
  void defocus(float focus_distance);
  void paint_blades();
};

cv::Vec3b pixel(const Colour& colour) {
  const Colour scaled = colour.max(0.0F).min(1.0F) * 255.0F + 0.5F;
  return {static_cast<std::uint8_t>(scaled[2]), static_cast<std::uint8_t>(scaled[1]),
          static_cast<std::uint8_t>(scaled[0])};
}

// x, y in SMAL units along the ground; texel is the size of a pixel there, which hides what is finer.
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

// Above the ground's edge: sky, and before it what stands on the horizon.
Colour Painter::far_colour(int column, int row, float above, const Eigen::Vector3f& ray) const {
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
  (void)ray;
  return blend(near, backdrop.sky_low, haze);
}

void Painter::paint_far_and_ground() {
  const GroundAxes axes(ground.up);
  // The row where the ground ends, for the sky's gradient: the horizon at the picture's middle column.
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
        out[column] = pixel(far_colour(column, row, above, ray));
      }
    }
  }
}

}  // namespace

cv::Scalar to_bgr(const Colour& colour) {
  const Colour scaled = colour.max(0.0F).min(1.0F) * 255.0F;
  return {scaled[2], scaled[1], scaled[0]};
}

}  // namespace q3d::pipeline::world
