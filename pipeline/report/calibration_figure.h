// The calibration as a picture: yield and AUC against the threshold, and the chosen points.
#pragma once

#include <span>
#include <string>

#include "filters/calibrated_pool.h"

namespace q3d::pipeline::report {

// An SVG document, one panel a pool.
std::string calibration_figure(std::span<const filters::CalibratedPool> pools);

// The same as text: a line for each tenth of the yield and for the chosen thresholds.
std::string calibration_table(const filters::CalibratedPool& pool);

}  // namespace q3d::pipeline::report
