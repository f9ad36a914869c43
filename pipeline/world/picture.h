// Makes a picture from a plan, with its full truth.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pipeline/render/rays.h"
#include "pipeline/world/annotator.h"
#include "pipeline/world/bodies.h"
#include "pipeline/world/coat.h"
#include "pipeline/world/framing.h"
#include "pipeline/world/noise.h"
#include "pipeline/world/plan.h"
#include "pipeline/world/subject.h"

namespace q3d::pipeline::world {

struct PictureTruth {
  cv::Size size_px;
  Framing framing;  // box, camera and translation
  Posture posture;
  std::array<Eigen::Vector3f, smal::kNumKeypoints> keypoints_3d;  // camera frame, without the translation
  std::array<SeenLandmark, smal::kNumKeypoints> keypoints;        // SMAL's 26, exact
  std::vector<Label> labels;                                      // the set's own keypoints, as annotated
};

struct Picture {
  PictureTruth truth;
  std::vector<std::uint8_t> jpeg;
  std::vector<std::uint8_t> mask_png;  // 255 = visible animal
};

// Holds what all pictures share. Immutable; render() is thread-safe.
class PictureRenderer {
 public:
  PictureRenderer(std::uint64_t seed, int picture_px);

  // Renders plans in the given order, the bodies together and the pictures in parallel. A picture depends on
  // the seed and its plan alone.
  std::vector<Picture> render(std::span<const PicturePlan> plans) const;

  const BodyModel& model() const { return model_; }
  const std::vector<Landmark>& landmarks(SetId set) const {
    return landmarks_[static_cast<std::size_t>(set)];
  }

 private:
  Picture render_one(const PicturePlan& plan, const Subject& subject, const Body& body) const;
  manifests::Rng stream(const PicturePlan& plan, std::uint64_t purpose) const;

  std::uint64_t seed_;
  int picture_px_;
  BodyModel model_;
  render::RayDevice device_;
  NoiseField noise_;
  CoatPainter painter_;
  std::array<std::vector<Landmark>, kSets> landmarks_;
};

}  // namespace q3d::pipeline::world
