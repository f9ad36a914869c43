#include "model/prima.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>
#include <torch/cuda.h>

#include <fstream>
#include <stdexcept>

#include "model/checkpoint.h"
#include "model/device.h"
#include "model/net.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

class PrimaTest : public ::testing::Test {
 protected:
  PrimaTest() {
    configure_compute(1);
    smal::tensors::save_asset(body_, testing::load_parity_asset(testing::parity_dir()));
  }

  Prima seeded(const PrimaConfig& config, torch::ScalarType dtype = torch::kFloat32) const {
    const std::filesystem::path path = scratch_.path() / "net.safetensors";
    write_initial_checkpoint(path, config, 3);
    return Prima::load(path, body_, torch::kCPU, dtype);
  }

  static torch::Tensor crops(std::int64_t batch) {
    at::manual_seed(11);
    return torch::randint(0, 256, {batch, 3, 256, 256}, torch::kUInt8);
  }

  static void expect_finite(const Prediction& prediction, std::int64_t batch) {
    const std::vector<std::pair<torch::Tensor, std::vector<std::int64_t>>> parts{
        {prediction.rotations, {batch, 35, 3, 3}},
        {prediction.betas, {batch, 41}},
        {prediction.camera, {batch, 3}},
        {prediction.translation, {batch, 3}},
        {prediction.keypoints_3d, {batch, 26, 3}},
        {prediction.keypoints_2d, {batch, 26, 2}},
        {prediction.aux_keypoints_2d, {batch, 26, 2}},
        {prediction.aux_keypoints_3d, {batch, 26, 3}},
        {prediction.init_betas, {batch, 41}},
        {prediction.shape_feature, {batch, 128}}};
    for (const auto& [tensor, shape] : parts) {
      EXPECT_EQ(tensor.sizes(), at::IntArrayRef(shape));
      EXPECT_TRUE(tensor.isfinite().all().item<bool>());
      EXPECT_EQ(tensor.scalar_type(), torch::kFloat32);
    }
  }

  testing::ScratchDir scratch_;
  std::filesystem::path body_ = scratch_.path() / "body.safetensors";
};

TEST_F(PrimaTest, SeededNetworksPredictFiniteBodies) {
  for (const std::string name : {"tiny", "small", "lite"}) {
    for (const auto dtype : {torch::kFloat32, torch::kBFloat16}) {
      SCOPED_TRACE(name);
      const Prima prima = seeded(named_config(name), dtype);
      expect_finite(prima.predict(prima.encode(prima.normalise(crops(2)))), 2);
    }
  }
}

TEST_F(PrimaTest, EncoderAndDecoderMayDifferInWidth) {
  PrimaConfig config = named_config("tiny");
  config.dec_dim = 48;
  config.dec_heads = 3;
  config.ief_iterations = 2;
  const Prima prima = seeded(config);
  expect_finite(prima.predict(prima.encode(prima.normalise(crops(1)))), 1);
}

TEST_F(PrimaTest, LoadedNetworkIsFrozenAndRecordsNothing) {
  const Prima prima = seeded(named_config("tiny"));
  EXPECT_FALSE(prima.net().is_training());
  for (const auto& parameter : prima.net().parameters()) EXPECT_FALSE(parameter.requires_grad());
}

TEST_F(PrimaTest, VerticesAreAddedWithoutChangingTheRest) {
  const Prima prima = seeded(named_config("tiny"));
  const ImageFeatures features = prima.encode(prima.normalise(crops(2)));
  const Prediction plain = prima.predict(features);
  const Prediction full = prima.predict(features, /*with_vertices=*/true);
  EXPECT_FALSE(plain.vertices.defined());
  EXPECT_EQ(full.vertices.sizes(), at::IntArrayRef({2, 3889, 3}));
  EXPECT_TRUE(torch::equal(plain.keypoints_3d, full.keypoints_3d));
}

// The float32 network is near: rounding is some 1e-7 of numbers around 1, and a tiny network amplifies it by
// less than a thousand.
TEST_F(PrimaTest, Float64NetworksComputeEverythingInFloat64) {
  const Prima exact = seeded(named_config("tiny"), torch::kFloat64);
  const torch::Tensor images = exact.normalise(crops(2));
  EXPECT_EQ(images.scalar_type(), torch::kFloat64);
  const Prediction prediction = exact.predict(exact.encode(images), /*with_vertices=*/true);
  const Prima single = seeded(named_config("tiny"));
  const Prediction rounded =
      single.predict(single.encode(single.normalise(crops(2))), /*with_vertices=*/true);
  const auto expect_near = [](const torch::Tensor& got, const torch::Tensor& expected) {
    EXPECT_EQ(got.scalar_type(), torch::kFloat64);
    EXPECT_EQ(expected.scalar_type(), torch::kFloat32);
    const double difference = (got - expected).abs().max().item<double>();
    EXPECT_LT(difference, 1e-4);
    EXPECT_GT(difference, 0.0);
  };
  expect_near(prediction.rotations, rounded.rotations);
  expect_near(prediction.betas, rounded.betas);
  expect_near(prediction.keypoints_2d, rounded.keypoints_2d);
  expect_near(prediction.vertices, rounded.vertices);
}

TEST_F(PrimaTest, ABodyInAnotherDtypeIsRefused) {
  const Prima single = seeded(named_config("tiny"));
  const smal::tensors::SmalBody exact = single.body().to_dtype(torch::kFloat64);
  auto net = std::make_shared<PrimaNet>(named_config("tiny"), Placement{});
  EXPECT_THROW(Prima(net, exact), std::invalid_argument);
}

TEST_F(PrimaTest, NormaliseUsesImageNetStatistics) {
  const Prima prima = seeded(named_config("tiny"));
  const torch::Tensor white = torch::full({1, 3, 256, 256}, 255, torch::kUInt8);
  const torch::Tensor normalised = prima.normalise(white);
  EXPECT_NEAR(normalised[0][0][0][0].item<double>(), (1.0 - 0.485) / 0.229, 1e-5);
  EXPECT_NEAR(normalised[0][2][255][255].item<double>(), (1.0 - 0.406) / 0.225, 1e-5);
}

TEST_F(PrimaTest, WrongArgumentsAreRefused) {
  const Prima prima = seeded(named_config("tiny"));
  EXPECT_THROW(prima.normalise(torch::zeros({1, 3, 256, 256})), std::invalid_argument);
  EXPECT_THROW(prima.normalise(torch::zeros({1, 3, 256, 255}, torch::kUInt8)), std::invalid_argument);
  EXPECT_THROW(prima.encode(torch::zeros({3, 256, 256})), std::invalid_argument);
  ImageFeatures features = prima.encode(prima.normalise(crops(2)));
  features.bio_token = features.bio_token.narrow(0, 0, 1);
  EXPECT_THROW(prima.predict(features), std::invalid_argument);
  features.image_tokens = features.image_tokens.narrow(1, 0, 100);
  EXPECT_THROW(prima.predict(features), std::invalid_argument);
}

TEST_F(PrimaTest, OtherDtypesAreRefused) {
  EXPECT_THROW(seeded(named_config("tiny"), torch::kFloat16), std::invalid_argument);
}

// In training mode gradients reach everything but the frozen BioCLIP encoder, and dropout makes two passes
// differ; in evaluation mode they are equal.
TEST_F(PrimaTest, TrainingModeTrains) {
  const Prima loaded = seeded(named_config("tiny"));  // its own matrices may be packed, and cannot learn
  const auto learner = load_net(smal::tensors::SafeTensors::open(scratch_.path() / "net.safetensors"),
                                named_config("tiny"), testing::load_parity_asset(testing::parity_dir()), {});
  PrimaNet& net = *learner;
  net.eval();
  const torch::Tensor images = loaded.normalise(crops(2));
  const auto forward = [&] {
    const ImageFeatures features = net.encode(images);
    const Decoder& decoder = net.decoder();
    const torch::Tensor betas = decoder.initial_betas(features.bio_token);
    return decoder.refine(decoder.remember(features.image_tokens), betas, decoder.own_parameters());
  };
  EXPECT_TRUE(torch::equal(forward().pose_6d, forward().pose_6d));
  net.train();
  const DecoderOutput output = forward();
  EXPECT_FALSE(torch::equal(output.pose_6d, forward().pose_6d));
  (output.pose_6d.sum() + output.betas.sum() + output.camera.sum() + output.aux_keypoints_2d.sum() +
   output.aux_keypoints_3d.sum())
      .backward();
  for (const auto& parameter : net.named_parameters()) {
    const bool frozen = parameter.key().find("species_model") != std::string::npos;
    const bool unused = parameter.key().find("shape_projector") != std::string::npos;  // its own loss
    EXPECT_EQ(parameter.value().grad().defined(), !frozen && !unused) << parameter.key();
  }
}

TEST(Device, NamesAreChecked) {
  EXPECT_EQ(choose_device("cpu").device, torch::Device(torch::kCPU));
  EXPECT_NE(choose_device("cpu").description.find("threads"), std::string::npos);
  for (const char* name : {"gpu", "cuda:", "cuda:x", "cuda:-1", "cuda:1x", "", "CPU"}) {
    EXPECT_THROW(choose_device(name), std::invalid_argument) << name;
  }
}

TEST(Device, AutoIsAlwaysUsable) {
  const DeviceChoice choice = choose_device("auto");
  const torch::Tensor ones = torch::ones({4}, torch::TensorOptions(choice.device));
  EXPECT_EQ(ones.sum().item<float>(), 4.0F);
  EXPECT_FALSE(choice.description.empty());
}

TEST(Device, AskingForAnAbsentGpuSaysSo) {
  if (torch::cuda::is_available()) GTEST_SKIP() << "a GPU is here";
  EXPECT_THROW(choose_device("cuda"), std::runtime_error);
  EXPECT_THROW(choose_device("cuda:1"), std::runtime_error);
}

TEST(Device, ThreadsMustBePositive) {
  EXPECT_THROW(configure_compute(0), std::invalid_argument);
  configure_compute(1);
  EXPECT_EQ(at::get_num_threads(), 1);
}

}  // namespace
}  // namespace q3d::model
