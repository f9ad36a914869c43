// Makes a body in front of the crop's camera from the decoder's numbers. Official code: PRIMA.forward_step.
#pragma once

#include <torch/types.h>

#include "model/decoder.h"
#include "model/net.h"
#include "model/prima.h"
#include "smal/tensors/body.h"

namespace q3d::model {

// Throws std::invalid_argument if the features do not have the network's shapes or their batch sizes
// disagree.
void require_features(const PrimaNet& net, const ImageFeatures& features);

// Converts pose_6d (B, 210) to rotations (B, 35, 3, 3).
torch::Tensor pose_rotations(const torch::Tensor& pose_6d);

// Returns the 26 keypoints of the posed body in the crop, (B, 26, 2) in crop units. Differentiable.
torch::Tensor projected_keypoints(const smal::tensors::SmalBody& body, const DecoderOutput& output,
                                  double focal_px);

// Returns the prediction of the decoder's output. initial_betas: (B, 41). Differentiable.
Prediction assemble(const PrimaNet& net, const smal::tensors::SmalBody& body, const DecoderOutput& output,
                    const torch::Tensor& initial_betas, bool with_vertices);
// The same without the shape_feature, the one number that needs weights of the network.
Prediction assemble_body(const smal::tensors::SmalBody& body, const DecoderOutput& output,
                         const torch::Tensor& initial_betas, double focal_px, bool with_vertices);

}  // namespace q3d::model
