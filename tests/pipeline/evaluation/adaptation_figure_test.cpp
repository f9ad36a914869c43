#include "pipeline/evaluation/adaptation_figure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/pipeline/evaluation/made_evaluation.h"

namespace q3d::pipeline::evaluation {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// One sample under the settings; AUC and PA-MPJPE by setting.
Evaluation evaluation_under(const SettingOptions& options, const std::vector<double>& auc) {
  Evaluation evaluation = testing::evaluation_of({testing::sample("a", manifests::Family::none, 0.0)});
  evaluation.settings = plan_settings(options).settings;
  SampleResult& sample = evaluation.datasets[0].samples[0];
  sample.values.resize(evaluation.settings.size());
  sample.betas.resize(evaluation.settings.size());
  for (std::size_t i = 0; i < auc.size(); ++i) {
    sample.values[i][index_of(Metric::auc)] = auc[i];
    sample.values[i][index_of(Metric::pa_mpjpe)] = 100.0 - auc[i];
  }
  return evaluation;
}

TEST(AdaptationFigure, PlacesTheIterates) {
  // "prediction" comes first and is not on the axis.
  const Evaluation evaluation = evaluation_under({0, {0, 10, 40}, {}}, {1.0, 50.0, 60.0, 90.0});
  const std::string svg = adaptation_figure(make_tables(evaluation));
  // x: 60 to 440 px for 0 to 40; y: 294 to 70 px for 50 to 90, behind a legend of 30 px.
  EXPECT_THAT(svg, HasSubstr("points=\"60.0,294.0 155.0,238.0 440.0,70.0 \"")) << "AUC";
  EXPECT_THAT(svg, HasSubstr("points=\"520.0,70.0 615.0,126.0 900.0,294.0 \"")) << "PA-MPJPE";
  EXPECT_THAT(svg, HasSubstr(">d/test</text>"));
  EXPECT_THAT(svg, Not(HasSubstr("visible keypoints"))) << "no share was asked for";
  EXPECT_THAT(svg, HasSubstr("height=\"350\""));
}

TEST(AdaptationFigure, PlacesTheSharesOfKeypoints) {
  const Evaluation evaluation = evaluation_under({30, {}, {0.5}}, {1.0, 90.0, 80.0});
  const std::string svg = adaptation_figure(make_tables(evaluation));
  EXPECT_THAT(svg, HasSubstr("points=\"60.0,294.0 440.0,70.0 \"")) << "50 %, then all";
  EXPECT_THAT(svg, HasSubstr("visible keypoints"));
}

TEST(AdaptationFigure, OnePointIsNoCurve) {
  const Evaluation evaluation = evaluation_under({30, {}, {}}, {50.0, 60.0});
  EXPECT_EQ(adaptation_figure(make_tables(evaluation)), "");
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
