// Computes the bodies of the world as plain arrays. No other part of the world uses LibTorch.
#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "pipeline/render/rays.h"
#include "smal/sizes.h"

namespace q3d::pipeline::world {

// The parameters that the network should find: SMAL's pose (axis-angle, rad; the first three numbers are the
// global orientation) and shape.
struct Posture {
  std::array<float, 3 * smal::kNumJoints> pose{};
  std::array<float, smal::kNumBetas> betas{};
};

// A posed body in SMAL units. It is rotated into the camera's frame, but the translation is not added.
struct Body {
  std::vector<Eigen::Vector3f> vertices;
  std::array<Eigen::Vector3f, smal::kNumKeypoints> keypoints;
};

// The mesh at rest: x to the head, y up, z to the animal's right.
struct RestMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<render::Triangle> triangles;
  std::vector<std::array<float, smal::kNumJoints>> skinning;  // weights of each vertex, sum 1
  std::array<std::vector<int>, smal::kNumKeypoints> keypoint_vertices;
};

class ShapeSpace;

class BodyModel {
 public:
  BodyModel();  // the synthetic quadruped
  ~BodyModel();
  BodyModel(const BodyModel&) = delete;
  BodyModel& operator=(const BodyModel&) = delete;

  const RestMesh& rest() const;
  const ShapeSpace& shapes() const;
  void save(const std::filesystem::path& asset) const;  // throws std::runtime_error
  // Returns bodies in the order of the postures. The numbers do not depend on the number of threads.
  std::vector<Body> pose(std::span<const Posture> postures) const;

 private:
  struct Model;
  std::unique_ptr<const Model> model_;
};

}  // namespace q3d::pipeline::world
