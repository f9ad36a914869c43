// Makes a body in front of the crop's camera from the decoder's numbers. Official code: PRIMA.forward_step.
#pragma once

#include <torch/types.h>

#include "model/decoder.h"
#include "model/net.h"
#include "model/prima.h"
#include "smal/tensors/body.h"

namespace q3d::model {

// Throws std::invalid_argument when the features do not have the network's shapes or batch sizes disagree.
void require_features(const PrimaNet& net, const ImageFeatures& features);

// pose_6d (B, 210) -> (B, 35, 3, 3).
torch::Tensor pose_rotations(const torch::Tensor& pose_6d);

// The 26 keypoints of the posed body in the crop: (B, 26, 2) crop units. Differentiable.
torch::Tensor projected_keypoints(const smal::tensors::SmalBody& body, const DecoderOutput& output,
                                  double focal_px);

// initial_betas (B, 41). Differentiable.
Prediction assemble(const PrimaNet& net, const smal::tensors::SmalBody& body, const DecoderOutput& output,
                    const torch::Tensor& initial_betas, bool with_vertices);

}  // namespace q3d::model
