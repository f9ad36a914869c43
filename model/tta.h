// Test-time adaptation: per-instance refinement of the keypoint embeddings and the three regression heads
// (4.5 M parameters at full size) against annotated 2D keypoints. Paper section "Test-time Adaptation";
// official code: demo_tta.tta_optimize. Batched: each instance has its own parameters, Adam moments and
// stopping rule. When one is finished, the next one takes its place, so that the batch stays full.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "filters/adaptation/schedule.h"
#include "model/decoder.h"
#include "model/prima.h"
#include "model/priors.h"

namespace q3d::model {

enum class TtaObjective {
  paper,  // 5.0 * aux + 0.5 * reprojection, mean absolute error over visible keypoints and both coordinates
  demo,   // sum of squared reprojection error / (visible + 1e-6)
};

struct TtaOptions {
  TtaObjective objective = TtaObjective::paper;
  double learning_rate = 1e-6;
  double aux_weight = 5.0;
  double reproj_weight = 0.5;
  // Weights of the mean squares of the whitened pose and of the whitened betas, which the paper's objective
  // lacks. With a weight above 0, `priors` is needed, on the network's device.
  double pose_prior_weight = 0.0;
  double shape_prior_weight = 0.0;
  std::optional<Priors> priors;
  std::vector<int> snapshots;  // iterates to keep beside the best and the last; ascending
  // Instances that adapt at a time; 0 = all. Instances start in their order, and which of them share an
  // iteration depends on schedules and numbers alone.
  std::int64_t slots = 0;
  std::function<void(std::int64_t finished)>
      progress;  // told how many instances have ended, whenever some have
};

// L_proj: mean over visible keypoints and both coordinates of |projected - annotated|.
struct TtaResult {
  Prediction best;  // the iterate of least L_proj, or of least held-out error; iteration 0 included
  Prediction last;  // the iterate after the last step taken
  // One for each of options.snapshots; an instance that stopped before shows its last iterate.
  std::vector<Prediction> snapshots;
  // An instance's curves are empty where nothing could be measured: no visible keypoint, or a target or a
  // first prediction that is not finite.
  std::vector<std::vector<double>> l_proj;  // per instance: L_proj of iterates 0..n in crop units
  // The same for the held-out keypoints alone (l_proj is of all visible ones). Empty where none is held out.
  std::vector<std::vector<double>> held_out;
  std::vector<std::vector<double>> loss;  // per instance: the objective at iterates 0..n
  std::vector<int> best_iteration;
};

// keypoints (B, 26, 3): x, y in crop units and a weight; visible iff weight > 0 (the value is not a weight
// here). schedules: one for each instance; their held-out keypoints must be visible. An instance without
// visible keypoints is left unchanged. One whose loss or numbers become non-finite keeps its last finite
// iterate. Vertices are not computed. Throws std::invalid_argument on shapes that disagree, a network in
// training mode, or options out of range.
TtaResult adapt(const Prima& prima, const ImageFeatures& features, const torch::Tensor& keypoints,
                const std::vector<filters::adaptation::Schedule>& schedules, const TtaOptions& options);

}  // namespace q3d::model
