#include "pipeline/training/batch_tensors.h"

#include <torch/types.h>

#include <memory>
#include <utility>
#include <vector>

#include "smal/camera.h"
#include "smal/sizes.h"

namespace q3d::pipeline::training {

model::TrainingBatch to_tensors(feed::FeedBatch&& from) {
  const auto batch = std::make_shared<feed::FeedBatch>(std::move(from));
  const auto view = [&batch](auto* data, std::vector<std::int64_t> shape, torch::ScalarType dtype) {
    shape.insert(shape.begin(), batch->size);
    return torch::from_blob(
        data, shape, [batch](void*) {}, dtype);
  };
  model::TrainingBatch result;
  result.images = view(batch->images.get(), {3, smal::kCropSidePx, smal::kCropSidePx}, torch::kFloat32);
  model::Targets& targets = result.targets;
  targets.keypoints_2d = view(batch->keypoints_2d.data(), {smal::kNumKeypoints, 3}, torch::kFloat32);
  targets.keypoints_3d = view(batch->keypoints_3d.data(), {smal::kNumKeypoints, 4}, torch::kFloat32);
  targets.rotations = view(batch->rotations.data(), {smal::kNumJoints, 3, 3}, torch::kFloat32);
  targets.betas = view(batch->betas.data(), {smal::kNumBetas}, torch::kFloat32);
  targets.has_pose = view(batch->has_pose.data(), {}, torch::kFloat32);
  targets.has_betas = view(batch->has_betas.data(), {}, torch::kFloat32);
  targets.family = view(batch->family.data(), {}, torch::kInt64);
  result.species = view(batch->species.data(), {}, torch::kInt64);
  return result;
}

}  // namespace q3d::pipeline::training
