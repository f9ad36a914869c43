// The settings under which the network is measured: its plain prediction, and test-time adaptation of several
// lengths and with fewer keypoints.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/device/network.h"

namespace q3d::pipeline::evaluation {

struct Setting {
  std::string name;  // "prediction", "TTA 30", "TTA 30 with 50 % of the keypoints", "iterate 20"
  bool uses_test_keypoints = false;
  int iterations = 0;          // adaptation steps at most
  double visible_share = 1.0;  // fraction of the visible keypoints that adaptation sees; metrics use all
};

// One adaptation of every sample. It gives the kept iterate, or the requested iterates.
struct TtaPass {
  int iterations = 0;
  double visible_share = 1.0;
  std::vector<int> iterates;  // ascending; empty: the kept iterate, which has the least L_proj
};

struct SettingOptions {
  int tta_iterations = 0;                // 0 = no adaptation
  std::vector<int> curve{};              // iterates to measure
  std::vector<double> visible_shares{};  // needs tta_iterations
};

struct Plan {
  std::vector<Setting> settings;  // the prediction, then the results of the passes in order
  std::vector<TtaPass> passes;
};

// Throws ConfigError on negative iterations, shares outside (0, 1], or shares without tta_iterations.
Plan plan_settings(const SettingOptions& options);

// Returns the keypoints with all but ceil(share * visible) of the visible ones hidden. The choice is random
// by seed and sample id, and the same on every machine. For one sample, the choice of a smaller share is part
// of that of a larger one.
device::CropKeypoints hide_keypoints(const device::CropKeypoints& keypoints, double share, std::uint64_t seed,
                                     const std::string& sample_id);

}  // namespace q3d::pipeline::evaluation
