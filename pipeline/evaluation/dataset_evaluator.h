// Runs one test set through the network, unit by unit: decode, predict, adapt, measure.
#pragma once

#include <functional>
#include <vector>

#include "pipeline/device/device_worker.h"
#include "pipeline/evaluation/evaluate.h"
#include "pipeline/run/progress.h"

namespace q3d::pipeline::evaluation {

// The inputs that measuring needs and does not change.
struct Instruments {
  const Plan* plan = nullptr;
  const device::BodyMeshes* meshes = nullptr;
  device::Network* network = nullptr;  // called on the device's thread only
  device::DeviceWorker* device = nullptr;
  std::uint64_t seed = 0;
};

// Returns the results of the records, in their order. A record that a loader failed keeps its failure, except
// no_visible_keypoints, because such a record still has 3D metrics. Throws std::runtime_error, Interrupted.
std::vector<SampleResult> evaluate_records(std::vector<manifests::SampleRecord> records,
                                           const Instruments& instruments, run::Progress& progress);

}  // namespace q3d::pipeline::evaluation
