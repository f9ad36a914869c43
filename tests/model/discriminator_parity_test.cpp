#include "model/discriminator.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "smal/tensors/rotation.h"
#include "tests/model/parity_net.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

// The golden weights: int8 times a power of two.
void load_golden(Discriminator& discriminator, const smal::tensors::SafeTensors& file) {
  std::ifstream stream(testing::parity_dir() / "discriminator.json");
  const nlohmann::json scales = nlohmann::json::parse(stream).at("meta").at("scales");
  const at::NoGradGuard no_grad;
  for (auto& parameter : discriminator.named_parameters()) {
    const std::string name = "discriminator." + parameter.key();
    const torch::Tensor values =
        file.tensor(name + "_i8").to(torch::kFloat64) * scales.at(name).get<double>();
    ASSERT_EQ(parameter.value().sizes(), values.sizes()) << name;
    parameter.value().copy_(values);
  }
}

// A score is a sum of some thousand products, each rounded to float32 relative to its size; the scores of the
// golden file are at most of size 1. The discriminator's weights are held in `dtype`.
void expect_scores_and_losses(torch::ScalarType dtype, double tolerance) {
  const smal::tensors::SafeTensors file = testing::parity_file("discriminator");
  const auto given = [&](const char* name) { return file.tensor(name).to(dtype); };
  Discriminator discriminator({torch::kCPU, dtype});
  load_golden(discriminator, file);
  const at::NoGradGuard no_grad;
  const torch::Tensor predicted = discriminator.forward(given("pose").view({-1, 34, 3, 3}), given("betas"));
  const torch::Tensor rotations = smal::tensors::axis_angle_to_matrix(given("gt_pose_aa").view({-1, 34, 3}));
  const torch::Tensor real = discriminator.forward(rotations, given("gt_betas"));
  testing::expect_close("out_fake", predicted, file.tensor("out_fake"), tolerance);
  testing::expect_close("out_real", real, file.tensor("out_real"), tolerance);
  const double adversarial = file.tensor("loss_adv").item<double>();
  EXPECT_NEAR(adversarial_loss(predicted).item<double>(), adversarial, 1e-5 * adversarial);
  const double own = file.tensor("loss_disc").item<double>();
  const torch::Tensor all_real = torch::ones({5}, dtype);
  EXPECT_NEAR(discriminator_loss(predicted, real, all_real).item<double>(), own, 1e-5 * own);
}

TEST(DiscriminatorParity, ScoresAndLosses) {
  expect_scores_and_losses(torch::kFloat64, 1e-6);
}

TEST(DiscriminatorParity, Float32ScoresAndLosses) {
  expect_scores_and_losses(torch::kFloat32, 4e-6);
}

}  // namespace
}  // namespace q3d::model
