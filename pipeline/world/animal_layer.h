// Renders the animal: its pixels, its shadow, and the points that its own body hides.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pipeline/render/rays.h"
#include "pipeline/world/bodies.h"
#include "pipeline/world/coat.h"
#include "pipeline/world/scene.h"

namespace q3d::pipeline::world {

class AnimalLayer {
 public:
  // body + translation is the animal's position in the camera's frame. rest and device must outlive this
  // object.
  AnimalLayer(const render::RayDevice& device, const RestMesh& rest, const Body& body,
              const Eigen::Vector3f& translation);

  // Darkens the ground (picture: BGR, 8 bit) where the animal hides the sun or most of the sky.
  void cast_shadow(cv::Mat& picture, const PictureCamera& camera, const Ground& ground,
                   const Light& light) const;

  // Paints the animal over the picture, edges antialiased, and returns its silhouette: 255 where it covers at
  // least half of a pixel, else 0.
  cv::Mat1b paint(cv::Mat& picture, const PictureCamera& camera, const Ground& ground, const Light& light,
                  const CoatPainter& painter, const Coat& coat, const Eigen::Vector3f& individual) const;

  // Returns 1 for each point of the body (camera frame, with translation) that the body itself hides by more
  // than the point's tolerance (SMAL units), else 0.
  std::vector<std::uint8_t> hidden(std::span<const Eigen::Vector3f> points,
                                   std::span<const float> tolerance) const;

  const std::vector<Eigen::Vector3f>& vertices() const { return vertices_; }

 private:
  struct Fragment;  // a pixel that shows the animal
  std::vector<Fragment> fragments(cv::Size picture_px, const PictureCamera& camera) const;

  const RestMesh& rest_;
  std::vector<Eigen::Vector3f> vertices_;
  std::vector<Eigen::Vector3f> normals_;
  render::RayMesh rays_;
};

}  // namespace q3d::pipeline::world
