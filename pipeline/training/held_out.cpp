#include "pipeline/training/held_out.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include "filters/metrics.h"
#include "model/prima.h"
#include "pipeline/training/batch_tensors.h"
#include "smal/keypoints.h"

namespace q3d::pipeline::training {
namespace {

const std::vector<double> kShares{0.05, 0.25, 0.5, 0.75, 0.95};

// The point of sample b and keypoint k in (B, 26, 2) or (B, 26, 3).
using Points = at::TensorAccessor<float, 3>;

// Appends L_proj of each sample of a batch that has one. projected (B, 26, 2), annotated (B, 26, 3) on the
// CPU.
void append_errors(const Points& projected, const Points& annotated, std::vector<double>& errors) {
  for (std::int64_t b = 0; b < projected.size(0); ++b) {
    smal::CropPoints predicted;
    smal::CropKeypoints labels;
    for (std::int64_t k = 0; k < smal::kNumKeypoints; ++k) {
      const auto at = static_cast<std::size_t>(k);
      predicted[at] = {projected[b][k][0], projected[b][k][1]};
      labels[at] = {annotated[b][k][0], annotated[b][k][1], annotated[b][k][2]};
    }
    const std::optional<double> error = filters::projection_error(predicted, labels);
    if (error) errors.push_back(*error);
  }
}

}  // namespace

device::NetworkDomain measure_domain(const settings::DomainConfig& config,
                                     const std::shared_ptr<model::PrimaNet>& net,
                                     const smal::tensors::SmalBody& body, const feed::Feed& feed) {
  net->eval();
  const model::Prima prima(net, body);
  std::vector<double> errors;
  for (std::int64_t draw = 0; draw < config.samples; draw += feed.batch_size()) {
    const model::TrainingBatch batch = to_tensors(feed.batch(draw));
    const model::ImageFeatures features = prima.encode(batch.images.to(prima.device()));
    const torch::Tensor projected =
        prima.predict(features).keypoints_2d.to(torch::kCPU, torch::kFloat32).contiguous();
    append_errors(projected.accessor<float, 3>(), batch.targets.keypoints_2d.accessor<float, 3>(), errors);
  }
  if (errors.empty() ||
      !std::all_of(errors.begin(), errors.end(), [](double e) { return std::isfinite(e); })) {
    throw std::runtime_error(fmt::format(
        "pool {}: {} of the {} held-out samples have an L_proj, expected finite numbers for all that have a "
        "visible keypoint",
        config.held_out, errors.size(), config.samples));
  }
  const auto count = static_cast<std::int64_t>(errors.size());
  return {device::pictures_from_string(config.pictures), config.trained_on, config.held_out, count,
          device::quantiles_of(std::move(errors), kShares)};
}

}  // namespace q3d::pipeline::training
