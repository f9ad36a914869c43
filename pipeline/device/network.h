// The network as the pipeline sees it: plain pictures and keypoints in, plain numbers out, without LibTorch.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "filters/adaptation/schedule.h"
#include "smal/body.h"
#include "smal/keypoints.h"

namespace q3d::pipeline::device {

// A body and its keypoints as the network gives them.
struct BodyPrediction : smal::Body {
  smal::Keypoints3d keypoints_3d{};
  smal::CropPoints keypoints_2d{};
  // These come from the decoder's keypoint tokens. The 3D ones are not centred.
  smal::CropPoints aux_keypoints_2d{};
  smal::Keypoints3d aux_keypoints_3d{};
};
bool is_finite(const BodyPrediction& body);

using smal::CropKeypoints;
using PatchView = std::span<const std::uint8_t>;  // 256 x 256 x 3 RGB, row-major

// What a network's encoders made of one picture. Only the network that made it can use it.
class PictureFeatures {
 public:
  PictureFeatures() = default;
  PictureFeatures(const PictureFeatures&) = delete;
  PictureFeatures& operator=(const PictureFeatures&) = delete;
  virtual ~PictureFeatures() = default;
};
using KeptFeatures = std::shared_ptr<const PictureFeatures>;

struct AdaptRequest {
  PatchView patch;        // not looked at if features are given
  KeptFeatures features;  // of the same picture, from `predict`; or null
  CropKeypoints keypoints{};
  filters::adaptation::Schedule schedule;
};

struct AdaptOutcome {
  BodyPrediction best;
  std::vector<double> curve;           // L_proj of iterates 0..n over all visible keypoints, crop units
  std::vector<double> held_out_curve;  // of the held-out ones alone; empty where there are none
  int best_iteration = 0;
  std::vector<BodyPrediction> snapshots;  // of the iterates that were asked for
};

// A loaded network. One caller at a time. Batches are formed from the elements of the span in their order, so
// a result depends on nothing but the span. pipeline/network makes one.
class Network {
 public:
  Network() = default;
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;
  virtual ~Network() = default;

  // `features`, unless it is null, gets an entry for each patch: its features, or null where the network
  // would make others of the same picture in another batch. So adaptation gives the same bits with kept
  // features and without.
  virtual std::vector<BodyPrediction> predict(std::span<const PatchView> patches,
                                              std::vector<KeptFeatures>* features = nullptr) = 0;
  // Adapts some requests at a time; when one ends, the next takes its place. `snapshots`: iterates to keep
  // beside the best one, ascending; an instance that stopped before shows its last iterate. `progress` is
  // told how many requests have ended, whenever some have.
  virtual std::vector<AdaptOutcome> adapt(std::span<const AdaptRequest> requests,
                                          const std::vector<int>& snapshots = {},
                                          const std::function<void(std::size_t ended)>& progress = {}) = 0;

  // "cpu (2 threads)", "cuda:0 NVIDIA H100 80GB HBM3": for people.
  virtual const std::string& device_description() const = 0;
  // A GPU that is present but cannot be used, and why; else empty.
  virtual const std::string& device_warning() const = 0;
};

}  // namespace q3d::pipeline::device
