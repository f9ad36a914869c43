#include <gtest/gtest.h>

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "pipeline/report/lettering.h"
#include "pipeline/report/overlay_painter.h"

namespace q3d::pipeline::report {
namespace {

bool shows(const cv::Mat& picture, const cv::Scalar& colour) {
  cv::Mat found;
  cv::inRange(picture, colour, colour, found);
  return cv::countNonZero(found) > 50;  // more than the anti-aliased edges of letters
}

TEST(OverlaySheet, TheLegendExplainsTheColoursOfItsPanelsAlone) {
  constexpr std::array kLabel{Panel::photo, Panel::label};
  const cv::Mat of_label = overlay_legend(kLabel, 1500);
  EXPECT_TRUE(shows(of_label, colours::kOrange));
  EXPECT_FALSE(shows(of_label, colours::kBlue));
  EXPECT_FALSE(shows(of_label, colours::kYellow));
  constexpr std::array kPrediction{Panel::prediction};
  EXPECT_TRUE(shows(overlay_legend(kPrediction, 1500), colours::kBlue));
  EXPECT_FALSE(shows(overlay_legend(kPrediction, 1500), colours::kOrange));
  const cv::Mat of_all = overlay_legend(kAllPanels, 1500);
  EXPECT_TRUE(shows(of_all, colours::kOrange) && shows(of_all, colours::kBlue) &&
              shows(of_all, colours::kYellow));
}

TEST(OverlaySheet, PhotographsNeedNoLegend) {
  constexpr std::array kPhoto{Panel::photo};
  EXPECT_TRUE(overlay_legend(kPhoto, 300).empty());
  const std::vector<cv::Mat> pictures(3, cv::Mat(40, 50, CV_8UC3, cv::Scalar::all(0)));
  const cv::Mat sheet = overlay_sheet(pictures, kPhoto, 2);
  EXPECT_EQ(sheet.size(), cv::Size(12 + 50 + 12 + 50 + 12, 12 + 40 + 12 + 40 + 12));
}

}  // namespace
}  // namespace q3d::pipeline::report
