// The result of calibration for the candidates that share thresholds.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "filters/calibrate.h"
#include "filters/yield_curve.h"

namespace q3d::filters {

// All candidates, or those of one dataset.
struct CalibratedPool {
  std::string dataset;  // empty: all datasets
  Calibration calibration;
  std::int64_t judged = 0;  // candidates with a prediction
  std::int64_t adapted =
      0;  // candidates of the middle band that were adapted, to see whether they reach delta
  std::vector<YieldPoint> curve;
  YieldPoint at_tau_low;
  YieldPoint at_tau_high;
};

}  // namespace q3d::filters
