#include "pipeline/statistics/accuracy.h"

#include <gtest/gtest.h>

#include "tests/pipeline/statistics/made_facts.h"

namespace q3d::pipeline::statistics {
namespace {

// Two candidates; the first is kept, and its label is nearer than its prediction.
Facts two() {
  Facts facts;
  facts.candidates = {candidate({}), candidate({.verdict = manifests::Verdict::discarded,
                                                .reason = manifests::Reason::error_too_large})};
  facts.candidates[0].prediction = fit({0.012F, 0.03F}, 0.9);
  facts.candidates[0].label = fit({0.001F, 0.012F}, 0.95);
  facts.candidates[1].prediction = fit({0.001F, 0.001F, 0.001F, 0.5F}, 0.7);
  return facts;
}

TEST(Accuracy, AveragesOverSamplesNotOverKeypoints) {
  const auto result = accuracy(two());
  const auto at = [&](const char* curve, double threshold) {
    for (std::size_t i = 0; i < result["thresholds"].size(); ++i) {
      if (std::abs(result["thresholds"][i].get<double>() - threshold) < 1e-9) {
        return result[curve]["pck"][i].get<double>();
      }
    }
    return -1.0;
  };
  EXPECT_DOUBLE_EQ(at("predictions", 0.02), 62.5) << "(1/2 + 3/4) / 2";
  EXPECT_DOUBLE_EQ(at("labels", 0.01), 50.0);
  EXPECT_DOUBLE_EQ(at("labels", 0.02), 100.0);
  EXPECT_DOUBLE_EQ(at("labels_before", 0.02), 50.0);
  EXPECT_DOUBLE_EQ(at("predictions", 0.0), 0.0) << "nothing is nearer than 0";
  EXPECT_DOUBLE_EQ(result["predictions"]["auc"].get<double>(), 80.0);
  EXPECT_EQ(result["predictions"]["samples"], 2);
  EXPECT_EQ(result["labels"]["samples"], 1);
}

TEST(KeypointTable, ComparesTheSameLabelsBeforeAndAfter) {
  const auto table = keypoint_table(two());
  ASSERT_EQ(table.size(), 26U);
  EXPECT_EQ(table[1]["name"], "right_eye");
  EXPECT_EQ(table[1]["visible"], 2);
  EXPECT_EQ(table[1]["kept"], 1);
  EXPECT_NEAR(table[1]["error_before"].get<double>(), 0.03, 1e-6) << "without the discarded candidate's";
  EXPECT_NEAR(table[1]["error_after"].get<double>(), 0.012, 1e-6);
  EXPECT_TRUE(table[3]["error_after"].is_null()) << "visible in the discarded candidate alone";
}

TEST(Accuracy, IsNullWithoutBodies) {
  Facts facts;
  facts.candidates = {candidate({})};
  EXPECT_TRUE(accuracy(facts)["predictions"].is_null());
  EXPECT_TRUE(accuracy(facts)["labels"].is_null());
}

}  // namespace
}  // namespace q3d::pipeline::statistics
