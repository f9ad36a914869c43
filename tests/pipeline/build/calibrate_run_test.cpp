#include "pipeline/build/calibrate_run.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace q3d::pipeline::build {
namespace {

TEST(ThresholdsLayer, IsAConfigLayer) {
  CalibrationSummary given;
  given.pools.resize(1);
  given.pools[0].dataset = "animals";
  given.pools[0].calibration.thresholds.tau_low = 0.2;
  given.pools[0].calibration.thresholds.tau_high = 0.4;
  given.pools[0].calibration.thresholds.delta = 0.05;
  const auto own = nlohmann::json::parse(thresholds_layer(given));
  EXPECT_EQ(
      own, nlohmann::json::parse(
               R"({"filter": {"datasets": {"animals": {"tau_low": 0.2, "tau_high": 0.4, "delta": 0.05}}}})"));
  given.pools[0].dataset = "";
  EXPECT_EQ(nlohmann::json::parse(thresholds_layer(given)),
            nlohmann::json::parse(R"({"filter": {"tau_low": 0.2, "tau_high": 0.4, "delta": 0.05}})"));
}

}  // namespace
}  // namespace q3d::pipeline::build
