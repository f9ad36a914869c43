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
  const torch::NoGradGuard no_grad;
  for (auto& parameter : discriminator.named_parameters()) {
    const std::string name = "discriminator." + parameter.key();
    const torch::Tensor values =
        file.tensor(name + "_i8").to(torch::kFloat32) * scales.at(name).get<double>();
    ASSERT_EQ(parameter.value().sizes(), values.sizes()) << name;
    parameter.value().copy_(values);
  }
}

TEST(DiscriminatorParity, ScoresAndLosses) {
  const smal::tensors::SafeTensors file = testing::parity_file("discriminator");
  Discriminator discriminator;
  load_golden(discriminator, file);
  const torch::NoGradGuard no_grad;
  const torch::Tensor predicted =
      discriminator.forward(file.tensor("pose").view({-1, 34, 3, 3}), file.tensor("betas"));
  testing::expect_close("out_fake", predicted, file.tensor("out_fake"), 1e-6);
  const torch::Tensor rotations =
      smal::tensors::axis_angle_to_matrix(file.tensor("gt_pose_aa").view({-1, 34, 3}));
  const torch::Tensor real = discriminator.forward(rotations, file.tensor("gt_betas"));
  testing::expect_close("out_real", real, file.tensor("out_real"), 1e-6);
  const double adversarial = file.tensor("loss_adv").item<double>();
  EXPECT_NEAR(adversarial_loss(predicted).item<double>(), adversarial, 1e-5 * adversarial);
  const double own = file.tensor("loss_disc").item<double>();
  EXPECT_NEAR(discriminator_loss(predicted, real, torch::ones({5})).item<double>(), own, 1e-5 * own);
}

}  // namespace
}  // namespace q3d::model
