#include "model/assemble.h"

#include <fmt/format.h>

#include <stdexcept>

#include "smal/sizes.h"
#include "smal/tensors/camera.h"
#include "smal/tensors/rotation.h"

namespace q3d::model {
namespace {

constexpr std::int64_t kJoints = smal::kNumJoints;

}  // namespace

void require_features(const PrimaNet& net, const ImageFeatures& features) {
  const torch::Tensor& tokens = features.image_tokens;
  const torch::Tensor& bio = features.bio_token;
  const std::int64_t width = net.config().embed_dim;
  if (tokens.dim() != 3 || tokens.size(1) != kImageTokens || tokens.size(2) != width) {
    throw std::invalid_argument(
        fmt::format("image_tokens: expected (B, {}, {}), got {} dimensions, {} numbers", kImageTokens, width,
                    tokens.dim(), tokens.numel()));
  }
  if (bio.dim() != 2 || bio.size(0) != tokens.size(0) || bio.size(1) != width) {
    throw std::invalid_argument(fmt::format("bio_token: expected ({}, {}), got {} dimensions, {} numbers",
                                            tokens.size(0), width, bio.dim(), bio.numel()));
  }
}

torch::Tensor pose_rotations(const torch::Tensor& pose_6d) {
  return smal::tensors::rot6d_to_matrix(pose_6d.unflatten(1, {kJoints, 6}));
}

torch::Tensor projected_keypoints(const smal::tensors::SmalBody& body, const DecoderOutput& output,
                                  double focal_px) {
  const torch::Tensor keypoints = body.keypoints(pose_rotations(output.pose_6d), output.betas);
  return smal::tensors::project_to_crop(
      keypoints, smal::tensors::translation_from_camera(output.camera, focal_px), focal_px);
}

Prediction assemble(const PrimaNet& net, const smal::tensors::SmalBody& body, const DecoderOutput& output,
                    const torch::Tensor& initial_betas, bool with_vertices) {
  Prediction prediction = assemble_body(body, output, initial_betas, net.config().focal_px, with_vertices);
  prediction.shape_feature = net.decoder().shape_feature(initial_betas);
  return prediction;
}

Prediction assemble_body(const smal::tensors::SmalBody& body, const DecoderOutput& output,
                         const torch::Tensor& initial_betas, double focal_px, bool with_vertices) {
  Prediction prediction;
  prediction.rotations = pose_rotations(output.pose_6d);
  prediction.betas = output.betas;
  prediction.camera = output.camera;
  prediction.translation = smal::tensors::translation_from_camera(output.camera, focal_px);
  // Keypoints are always computed in the same way, so that a request for vertices changes no bit of them.
  prediction.keypoints_3d = body.keypoints(prediction.rotations, output.betas);
  if (with_vertices) prediction.vertices = body.forward(prediction.rotations, output.betas).vertices;
  prediction.keypoints_2d =
      smal::tensors::project_to_crop(prediction.keypoints_3d, prediction.translation, focal_px);
  prediction.aux_keypoints_2d = output.aux_keypoints_2d;
  prediction.aux_keypoints_3d = output.aux_keypoints_3d;
  prediction.init_betas = initial_betas;
  return prediction;
}

}  // namespace q3d::model
