// The forward pass against numbers computed by the official code, intermediate tensors included.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "model/assemble.h"
#include "model/net.h"
#include "tests/model/parity_net.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

using testing::expect_close;
using testing::few_roundings;
using testing::kFloat32Factor;
using testing::kNoiseFactor;
using testing::TensorMap;

TensorMap as_official(const Prediction& prediction) {
  return {{"out_global_orient", prediction.rotations.narrow(1, 0, 1)},
          {"out_pose", prediction.rotations.narrow(1, 1, 34)},
          {"out_betas", prediction.betas},
          {"out_pred_cam", prediction.camera},
          {"out_pred_cam_t", prediction.translation},
          {"out_pred_keypoints_3d", prediction.keypoints_3d},
          {"out_pred_keypoints_2d", prediction.keypoints_2d},
          {"out_inter_keypoints_2d", prediction.aux_keypoints_2d},
          {"out_inter_keypoints_3d", prediction.aux_keypoints_3d},
          {"out_init_betas", prediction.init_betas},
          {"out_shape_feat", prediction.shape_feature},
          {"out_pred_vertices", prediction.vertices}};
}

// Every observed intermediate under its official name, and the whole prediction computed while observing.
TensorMap observe_all(const Prima& prima, const torch::Tensor& input_index) {
  const at::NoGradGuard no_grad;
  TensorMap seen;
  const Observer observe = [&](const std::string& name, const torch::Tensor& tensor) { seen[name] = tensor; };
  const ImageFeatures features = prima.net().encode(testing::parity_images(prima, input_index), observe);
  seen["backbone_feat"] = features.image_tokens.transpose(1, 2).unflatten(2, {kTokenRows, kTokenColumns});
  seen["bio_token"] = features.bio_token;
  seen["bioclip_resized_img"] = seen.at("bioclip_resized_img").slice(2, 0, {}, 4).slice(3, 0, {}, 4);
  const Decoder& decoder = prima.net().decoder();
  const torch::Tensor betas = decoder.initial_betas(features.bio_token);
  const DecoderMemory memory = decoder.remember(features.image_tokens, observe);
  const DecoderOutput output = decoder.refine(memory, betas, decoder.own_parameters(), observe);
  // The official code keeps the image features inside the tokens and the encoded positions beside them.
  torch::Tensor embeddings = seen.at("ief0_layer0_tokens").clone();
  embeddings.narrow(1, 1, kKeypoints) += seen.at("ief0_upd0_features_2d");
  seen["ief0_upd0_token_embeddings_after_kp2d"] = embeddings;
  torch::Tensor augment = torch::zeros_like(embeddings);
  augment.narrow(1, 1, kKeypoints) += seen.at("ief0_upd0_augment_2d");
  seen["ief0_upd0_token_augment_after_kp2d"] = augment;
  seen.merge(as_official(assemble(prima.net(), prima.body(), output, betas, /*with_vertices=*/true)));
  return seen;
}

// float32 rounds sums that moved weights do not show, so twice their noise. The resized picture has no
// weights: its samples lie at float32 coordinates of up to 256 px (rounded by 1.5e-5 px), and the normalised
// picture changes by up to 4.5 from one pixel to the next.
torch::Tensor intermediate_tolerance(const std::string& name, const torch::Tensor& noise,
                                     const torch::Tensor& expected) {
  constexpr double kResized = 1.5e-5 * 4.5;
  return 2.0 * (kNoiseFactor * noise + few_roundings(expected)) +
         (name == "bioclip_resized_img" ? kResized : 0.0);
}

class ForwardParity : public ::testing::TestWithParam<std::string> {
 protected:
  Prima prima(torch::ScalarType dtype) const { return testing::parity_prima(GetParam(), dtype); }
  torch::Tensor input_index() const { return golden_.tensor("input_index"); }
  Prediction predict(const Prima& prima) const {
    return prima.predict(prima.encode(testing::parity_images(prima, input_index())), /*with_vertices=*/true);
  }
  // Returns how far the official code's own float32 output is from its float64 one.
  double stated_noise(const std::string& name) const {
    std::ifstream stream(testing::parity_dir() / ("forward_" + GetParam() + ".json"));
    return nlohmann::json::parse(stream).at("meta").at("fp32_vs_fp64_max_abs").at(name);
  }

  smal::tensors::SafeTensors golden_ = testing::parity_file("forward_" + GetParam());
};

TEST_P(ForwardParity, EveryOutput) {
  for (const auto& [name, tensor] : as_official(predict(prima(torch::kFloat64)))) {
    expect_close(name, tensor, golden_.tensor(name), 1.5 * stated_noise(name) + 1e-7);
  }
}

TEST_P(ForwardParity, EveryIntermediate) {
  const auto compute = [&](const Prima& prima) { return observe_all(prima, input_index()); };
  const TensorMap seen = compute(prima(torch::kFloat64));
  const TensorMap noise = testing::float32_noise(GetParam(), testing::parity_config(GetParam()), compute);
  int compared = 0;
  for (const std::string& name : golden_.names()) {
    if (name == "input_index" || name == "focal_length" || name == "bioclip_feature_quick_gelu") {
      continue;  // inputs, and what another test looks at
    }
    ASSERT_TRUE(seen.contains(name)) << name << " is not observed";
    const torch::Tensor expected = golden_.tensor(name);
    expect_close(name, seen.at(name), expected, intermediate_tolerance(name, noise.at(name), expected));
    ++compared;
  }
  EXPECT_GE(compared, 20);
}

// float32 is what users run.
TEST_P(ForwardParity, Float32IsNearFloat64) {
  const auto compute = [&](const Prima& prima) { return as_official(predict(prima)); };
  const TensorMap exact = compute(prima(torch::kFloat64));
  const TensorMap noise = testing::float32_noise(GetParam(), testing::parity_config(GetParam()), compute);
  for (const auto& [name, tensor] : compute(prima(torch::kFloat32))) {
    EXPECT_EQ(tensor.scalar_type(), torch::kFloat32) << name;
    expect_close(name, tensor, exact.at(name), kFloat32Factor * noise.at(name) + few_roundings(tensor));
  }
}

TEST_P(ForwardParity, OneByOneAsInABatch) {
  const Prima exact = prima(torch::kFloat64);
  const torch::Tensor images = testing::parity_images(exact, input_index());
  const Prediction together = exact.predict(exact.encode(images));
  for (std::int64_t i = 0; i < images.size(0); ++i) {
    const Prediction alone = exact.predict(exact.encode(images.narrow(0, i, 1)));
    expect_close("rotations", alone.rotations[0], together.rotations[i], 1e-10);
    expect_close("keypoints_2d", alone.keypoints_2d[0], together.keypoints_2d[i], 1e-10);
  }
}

// bfloat16 has 8 bits of mantissa; matrices alone are rounded, so outputs agree to about a percent.
TEST_P(ForwardParity, BFloat16IsNearFloat32) {
  const Prima single = prima(torch::kFloat32);
  const Prediction exact = predict(single);
  const smal::tensors::SmalAsset& asset = single.body().asset();
  auto net = load_net(testing::parity_file("weights_" + GetParam()), single.config(), asset,
                      {torch::kCPU, torch::kBFloat16});
  net->eval();
  net->pack();
  const Prediction rough = predict(Prima(net, single.body()));
  EXPECT_EQ(rough.rotations.scalar_type(), torch::kFloat32);
  expect_close("rotations", rough.rotations, exact.rotations, 0.1);
  expect_close("camera", rough.camera, exact.camera, 0.02);
  expect_close("keypoints_2d", rough.keypoints_2d, exact.keypoints_2d, 0.05);
  EXPECT_GT((rough.rotations - exact.rotations).abs().max().item<double>(), 1e-5) << "not bfloat16 at all";
}

// The variant exists for some of the fixtures only.
TEST(BioClipParity, QuickGelu) {
  const std::string name = "bioclip_feature_quick_gelu";
  int compared = 0;
  for (const std::string which : {"A", "B"}) {
    const smal::tensors::SafeTensors golden = testing::parity_file("forward_" + which);
    if (!golden.contains(name)) continue;
    PrimaConfig config = testing::parity_config(which);
    config.clip_quick_gelu = true;
    const auto compute = [&](const Prima& prima) {
      const at::NoGradGuard no_grad;
      TensorMap seen;
      prima.net().bioclip().forward(
          testing::parity_images(prima, golden.tensor("input_index")),
          [&](const std::string& label, const torch::Tensor& tensor) { seen[label] = tensor; });
      return TensorMap{{name, seen.at("bioclip_feature")}};
    };
    const TensorMap noise = testing::float32_noise(which, config, compute);
    const TensorMap seen = compute(testing::parity_prima(which, config, torch::kFloat64));
    expect_close(name, seen.at(name), golden.tensor(name), kNoiseFactor * noise.at(name));
    ++compared;
  }
  EXPECT_GE(compared, 1);
}

INSTANTIATE_TEST_SUITE_P(Fixtures, ForwardParity, ::testing::Values("A", "B"));

}  // namespace
}  // namespace q3d::model
