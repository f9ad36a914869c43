// The calibration as a picture: yield and AUC against the threshold, and the chosen points.
#pragma once

#include <string>

#include "pipeline/build/calibrate_run.h"

namespace q3d::pipeline::report {

// An SVG document, one panel a pool.
std::string calibration_figure(const build::CalibrationSummary& summary);

// The same as text: a line for each tenth of the yield and for the chosen thresholds.
std::string calibration_table(const build::CalibratedPool& pool);

}  // namespace q3d::pipeline::report
