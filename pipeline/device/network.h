// The pipeline's interface of the network. It takes plain pictures and keypoints and returns plain numbers,
// without LibTorch.
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

// The features that a network's encoders computed for one picture. Only the network that made them can use
// them.
class PictureFeatures {
 public:
  PictureFeatures() = default;
  PictureFeatures(const PictureFeatures&) = delete;
  PictureFeatures& operator=(const PictureFeatures&) = delete;
  virtual ~PictureFeatures() = default;
};
using KeptFeatures = std::shared_ptr<const PictureFeatures>;

struct AdaptRequest {
  PatchView patch;        // unused if features are given
  KeptFeatures features;  // features of the same picture from `predict`, or null
  CropKeypoints keypoints{};
  filters::adaptation::Schedule schedule;
};

struct AdaptOutcome {
  BodyPrediction best;
  std::vector<double> curve;           // L_proj of iterates 0..n over all visible keypoints, crop units
  std::vector<double> held_out_curve;  // the same over the held-out keypoints only; empty if there are none
  int best_iteration = 0;
  std::vector<BodyPrediction> snapshots;  // bodies of the requested iterates
};

// A loaded network. Only one thread may call it at a time. Batches are formed from the elements of the span
// in their order, so a result depends on nothing but the span. pipeline/network makes one.
class Network {
 public:
  Network() = default;
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;
  virtual ~Network() = default;

  // `features`, unless it is null, receives an entry for each patch: its features, or null if the network
  // would compute different ones for the same picture in another batch. So adaptation gives the same bits
  // with and without kept features.
  virtual std::vector<BodyPrediction> predict(std::span<const PatchView> patches,
                                              std::vector<KeptFeatures>* features = nullptr) = 0;
  // Adapts some requests at a time; when one ends, the next takes its place. `snapshots`: iterates to keep
  // beside the best one, ascending; for a request that ended earlier, the last iterate is returned.
  // `progress` is called with the number of requests that have ended, whenever some end.
  virtual std::vector<AdaptOutcome> adapt(std::span<const AdaptRequest> requests,
                                          const std::vector<int>& snapshots = {},
                                          const std::function<void(std::size_t ended)>& progress = {}) = 0;

  // Returns the device for people: "cpu (2 threads)", "cuda:0 NVIDIA H100 80GB HBM3".
  virtual const std::string& device_description() const = 0;
  // Names a GPU that is present but cannot be used, and says why; else empty.
  virtual const std::string& device_warning() const = 0;
};

}  // namespace q3d::pipeline::device
