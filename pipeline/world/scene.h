// The geometry of one picture, in the camera frame of the network: x right, y down, z forward, SMAL units.
#pragma once

#include <Eigen/Core>

namespace q3d::pipeline::world {

using Colour = Eigen::Array3f;  // red, green, blue as a screen shows them, [0, 1]

inline Colour rgb(int red, int green, int blue) {
  return Colour(red, green, blue) / 255.0F;
}
inline Colour blend(const Colour& a, const Colour& b, float t) {
  return a + (b - a) * t;
}

// A pinhole camera. Integer pixel coordinates are pixel centres, as in OpenCV's warps.
struct PictureCamera {
  double focal_px = 0.0;
  double centre_x_px = 0.0;
  double centre_y_px = 0.0;

  Eigen::Vector3f ray(double x_px, double y_px) const {
    return {static_cast<float>((x_px - centre_x_px) / focal_px),
            static_cast<float>((y_px - centre_y_px) / focal_px), 1.0F};
  }
  Eigen::Vector2d project(const Eigen::Vector3f& p) const {
    return {centre_x_px + focal_px * p.x() / p.z(), centre_y_px + focal_px * p.y() / p.z()};
  }
};

// The ground on which the animal stands: all points X with up . X = level. The camera is above it.
struct Ground {
  Eigen::Vector3f up{0.0F, -1.0F, 0.0F};
  float level = -1.0F;

  // Returns the multiple of `ray` that lies on the ground, or a negative number if the ray goes to the sky.
  float hit(const Eigen::Vector3f& ray) const {
    const float fall = up.dot(ray);
    return fall < -1e-4F ? level / fall : -1.0F;
  }
};

struct Light {
  Eigen::Vector3f to_sun{0.0F, -1.0F, 0.0F};  // unit length
  Colour sun{1.0F, 1.0F, 1.0F};               // linear light, not screen values
  Colour sky{0.5F, 0.5F, 0.5F};               // from above
  Colour bounce{0.3F, 0.3F, 0.3F};            // from the ground
  float ground_shadow = 0.5F;  // fraction of the ground's brightness that the sun's shadow removes
};

}  // namespace q3d::pipeline::world
