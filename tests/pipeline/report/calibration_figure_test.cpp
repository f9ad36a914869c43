#include "pipeline/report/calibration_figure.h"

#include <gtest/gtest.h>

#include <limits>

namespace q3d::pipeline::report {
namespace {

// tau_high 0.4, so the axis ends at 0.5.
std::vector<filters::CalibratedPool> pools() {
  filters::CalibratedPool pool;
  pool.dataset = "animals";
  pool.judged = 4;
  pool.curve = {{0.1, 0.25, 90.0}, {0.25, 0.5, 80.0}, {0.45, 0.75, 75.0}, {2.0, 1.0, 60.0}};
  pool.at_tau_low = {0.2, 0.25, 90.0};
  pool.at_tau_high = {0.4, 0.5, 80.0};
  std::vector<filters::CalibratedPool> result{pool, pool};
  result[1].dataset = "";
  result[1].at_tau_low = {0.05, 0.0, std::numeric_limits<double>::quiet_NaN()};
  return result;
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(CalibrationFigure, PlacesCurvesAndChosenPoints) {
  const std::string svg = calibration_figure(pools());
  // x: 60 to 700 px for 0 to 0.5; y: 320 to 60 px for 0 to 100 %.
  EXPECT_TRUE(holds(svg, "points=\"188.0,255.0 380.0,190.0 636.0,125.0 \""))
      << "yield, without the last point";
  EXPECT_TRUE(holds(svg, "points=\"188.0,86.0 380.0,112.0 636.0,125.0 \"")) << "AUC";
  EXPECT_TRUE(holds(svg, "<circle cx=\"572.0\" cy=\"190.0\"")) << "yield at tau_high";
  EXPECT_TRUE(holds(svg, "<circle cx=\"572.0\" cy=\"112.0\"")) << "AUC at tau_high";
  EXPECT_TRUE(holds(svg, "tau_low 0.2: yield 25.0 %"));
  EXPECT_TRUE(holds(svg, "animals: 4 predictions"));
  EXPECT_TRUE(holds(svg, "all datasets: 4 predictions")) << "a panel a pool";
  EXPECT_FALSE(holds(svg, "nan"));
}

TEST(CalibrationTable, ShowsTenthsAndTheChosenPoints) {
  const std::string text = calibration_table(pools()[0]);
  EXPECT_EQ(text,
            "   threshold  yield %    AUC %\n"
            "         0.1     25.0    90.00\n"
            "         0.2     25.0    90.00  <- tau_low\n"
            "        0.25     50.0    80.00\n"
            "         0.4     50.0    80.00  <- tau_high\n"
            "        0.45     75.0    75.00\n"
            "           2    100.0    60.00\n");
}

}  // namespace
}  // namespace q3d::pipeline::report
