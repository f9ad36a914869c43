#include "model/encoder_trainer.h"

#include <gtest/gtest.h>

#include "model/vit.h"

namespace q3d::model {
namespace {

// x, y in px of the 256-px crop.
TokenTargets target_at(double x_px, double y_px, double weight = 1.0) {
  torch::Tensor keypoints = torch::zeros({1, 26, 3});
  keypoints[0][4][0] = x_px / 256.0 - 0.5;
  keypoints[0][4][1] = y_px / 256.0 - 0.5;
  keypoints[0][4][2] = weight;
  return token_targets(keypoints);
}

double share(const TokenTargets& targets, std::int64_t row, std::int64_t column) {
  return targets.share[0][4][row * kTokenColumns + column].item<double>();
}

TEST(TokenTargets, ATokensCentreIsItsOwn) {
  // Patch (row 3, column 5) covers rows 46 to 61 and, 32 px further right, columns 110 to 125.
  const TokenTargets targets = target_at(32.0 + 5 * 16 + 6, 3 * 16 + 6);
  EXPECT_NEAR(share(targets, 3, 5), 1.0, 1e-5);
  EXPECT_NEAR(targets.share[0][4].sum().item<double>(), 1.0, 1e-5);
  EXPECT_EQ(targets.weight[0][4].item<double>(), 1.0);
  EXPECT_EQ(targets.weight.sum().item<double>(), 1.0);
}

TEST(TokenTargets, BetweenTokensTheSharesAreBilinear) {
  const TokenTargets targets = target_at(32.0 + 5 * 16 + 6 + 4, 3 * 16 + 6 + 8, 0.25);
  EXPECT_NEAR(share(targets, 3, 5), 0.5 * 0.75, 1e-5);
  EXPECT_NEAR(share(targets, 4, 5), 0.5 * 0.75, 1e-5);
  EXPECT_NEAR(share(targets, 3, 6), 0.5 * 0.25, 1e-5);
  EXPECT_NEAR(share(targets, 4, 6), 0.5 * 0.25, 1e-5);
  EXPECT_EQ(targets.weight[0][4].item<double>(), 0.25);
}

TEST(TokenTargets, OutsideTheGridNothingIsLearnt) {
  EXPECT_EQ(target_at(20.0, 100.0).weight.sum().item<double>(), 0.0);   // left of the ViT's columns
  EXPECT_EQ(target_at(240.0, 100.0).weight.sum().item<double>(), 0.0);  // right of them
  EXPECT_EQ(target_at(128.0, 255.0).weight.sum().item<double>(), 0.0);  // below the last patch
  EXPECT_EQ(target_at(128.0, 1.0).weight.sum().item<double>(), 1.0);    // within the first
  EXPECT_NEAR(share(target_at(38.0, 1.0), 0, 0), 1.0, 1e-5);
}

}  // namespace
}  // namespace q3d::model
