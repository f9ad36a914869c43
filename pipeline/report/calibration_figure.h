// Draws the calibration: yield and AUC against the threshold, and the chosen points.
#pragma once

#include <span>
#include <string>

#include "filters/calibrated_pool.h"

namespace q3d::pipeline::report {

// Returns an SVG document with one panel for each pool.
std::string calibration_figure(std::span<const filters::CalibratedPool> pools);

// Returns the same as text, with a line for each tenth of the yield and for the chosen thresholds.
std::string calibration_table(const filters::CalibratedPool& pool);

}  // namespace q3d::pipeline::report
