// The forward pass against numbers computed by the official code, intermediate tensors included.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "model/assemble.h"
#include "model/net.h"
#include "tests/model/parity_net.h"

namespace q3d::model {
namespace {

using testing::expect_close;

constexpr double kTolerance = 1e-5;

// Sampling multiplies the noise of a 2D keypoint (4e-7) by 16 cells and by the step between neighbouring
// cells (about 4): up to 3e-5 in the tokens from there on. Outputs and everything before stay within
// kTolerance.
constexpr double kSampledTolerance = 5e-5;

std::map<std::string, torch::Tensor> as_official(const Prediction& prediction) {
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

class ForwardParity : public ::testing::TestWithParam<std::string> {
 protected:
  ForwardParity()
      : prima_(testing::parity_prima(GetParam())),
        golden_(testing::parity_file("forward_" + GetParam())),
        images_(testing::parity_images(prima_, golden_.tensor("input_index"))) {}

  // Every observed intermediate, and the whole prediction computed while observing.
  std::map<std::string, torch::Tensor> observe_all() const {
    const torch::NoGradGuard no_grad;
    std::map<std::string, torch::Tensor> seen;
    const Observer observe = [&](const std::string& name, const torch::Tensor& tensor) {
      seen[name] = tensor;
    };
    const ImageFeatures features = prima_.net().encode(images_, observe);
    seen["backbone_feat"] = features.image_tokens.transpose(1, 2).unflatten(2, {kTokenRows, kTokenColumns});
    seen["bio_token"] = features.bio_token;
    const Decoder& decoder = prima_.net().decoder();
    const torch::Tensor betas = decoder.initial_betas(features.bio_token);
    const DecoderMemory memory = decoder.remember(features.image_tokens, observe);
    const DecoderOutput output = decoder.refine(memory, betas, decoder.own_parameters(), observe);
    seen.merge(as_official(assemble(prima_.net(), prima_.body(), output, betas, /*with_vertices=*/true)));
    return seen;
  }

  Prima prima_;
  smal::tensors::SafeTensors golden_;
  torch::Tensor images_;
};

TEST_P(ForwardParity, EveryOutput) {
  const Prediction prediction = prima_.predict(prima_.encode(images_), /*with_vertices=*/true);
  for (const auto& [name, tensor] : as_official(prediction)) {
    expect_close(name, tensor, golden_.tensor(name), kTolerance);
  }
}

TEST_P(ForwardParity, EveryIntermediate) {
  const auto seen = observe_all();
  int compared = 0;
  for (const std::string& name : golden_.names()) {
    if (name == "input_index" || name == "focal_length" || name == "bioclip_feature_quick_gelu" ||
        name.find("_after_kp2d") != std::string::npos) {
      continue;  // inputs, and what other tests look at
    }
    ASSERT_TRUE(seen.count(name)) << name << " is not observed";
    torch::Tensor tensor = seen.at(name);
    if (name == "bioclip_resized_img") tensor = tensor.slice(2, 0, {}, 4).slice(3, 0, {}, 4);
    const bool sampled = name.find("_tokens") != std::string::npos && name.rfind("ief", 0) == 0 &&
                         name.find("layer0_tokens") == std::string::npos;
    expect_close(name, tensor, golden_.tensor(name), sampled ? kSampledTolerance : kTolerance);
    ++compared;
  }
  EXPECT_GE(compared, 20);
}

// The official code keeps the image features inside the tokens and the encoded positions beside them.
TEST_P(ForwardParity, FirstKeypointUpdate) {
  const auto seen = observe_all();
  torch::Tensor embeddings = seen.at("ief0_layer0_tokens").clone();
  embeddings.narrow(1, 1, kKeypoints) += seen.at("ief0_upd0_features_2d");
  expect_close("embeddings", embeddings, golden_.tensor("ief0_upd0_token_embeddings_after_kp2d"),
               kSampledTolerance);
  torch::Tensor augment = torch::zeros_like(embeddings);
  augment.narrow(1, 1, kKeypoints) += seen.at("ief0_upd0_augment_2d");
  expect_close("augment", augment, golden_.tensor("ief0_upd0_token_augment_after_kp2d"), kTolerance);
}

TEST_P(ForwardParity, OneByOneAsInABatch) {
  const Prediction together = prima_.predict(prima_.encode(images_));
  for (std::int64_t i = 0; i < images_.size(0); ++i) {
    const Prediction alone = prima_.predict(prima_.encode(images_.narrow(0, i, 1)));
    expect_close("rotations", alone.rotations[0], together.rotations[i], kTolerance);
    expect_close("keypoints_2d", alone.keypoints_2d[0], together.keypoints_2d[i], kTolerance);
  }
}

// bfloat16 has 8 bits of mantissa; matrices alone are rounded, so outputs agree to about a percent.
TEST_P(ForwardParity, BFloat16IsNearFloat32) {
  const Prediction exact = prima_.predict(prima_.encode(images_));
  const smal::tensors::SmalAsset& asset = prima_.body().asset();
  auto net = load_net(testing::parity_file("weights_" + GetParam()), prima_.config(), asset,
                      {torch::kCPU, torch::kBFloat16});
  net->eval();
  const Prima half(net, prima_.body());
  const Prediction rough = half.predict(half.encode(images_));
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
    const Prima quick = testing::parity_prima(which, config);
    torch::Tensor feature;
    quick.net().bioclip().forward(testing::parity_images(quick, golden.tensor("input_index")),
                                  [&](const std::string& seen, const torch::Tensor& tensor) {
                                    if (seen == "bioclip_feature") feature = tensor;
                                  });
    expect_close(name, feature, golden.tensor(name), kTolerance);
    ++compared;
  }
  EXPECT_GE(compared, 1);
}

INSTANTIATE_TEST_SUITE_P(Fixtures, ForwardParity, ::testing::Values("A", "B"));

}  // namespace
}  // namespace q3d::model
