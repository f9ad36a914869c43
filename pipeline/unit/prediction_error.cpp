#include "pipeline/unit/prediction_error.h"

#include <limits>

#include "filters/metrics.h"
#include "pipeline/unit/annotated_body.h"

namespace q3d::pipeline::unit {

double error_of(const PredictedSample& sample, const device::CropKeypoints& keypoints) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (sample.failure != manifests::Reason::none || !has_projection(sample.body.keypoints_2d)) return kNone;
  return filters::projection_error(sample.body.keypoints_2d, keypoints).value_or(kNone);
}

}  // namespace q3d::pipeline::unit
