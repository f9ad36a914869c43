#include "model/checkpoint.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "model/prima.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

using Tensors = std::map<std::string, torch::Tensor>;

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

bool mentions(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class Checkpoint : public ::testing::Test {
 protected:
  Checkpoint() {
    write_initial_checkpoint(good_, config_, 7);
    const auto file = smal::tensors::SafeTensors::open(good_);
    for (const std::string& name : file.names()) tensors_[name] = file.tensor(name).clone();
  }

  std::filesystem::path write(const Tensors& tensors) const {
    const std::filesystem::path path = scratch_.path() / "changed.safetensors";
    write_checkpoint(path, config_, {tensors.begin(), tensors.end()});
    return path;
  }

  std::shared_ptr<PrimaNet> load(const std::filesystem::path& path) const {
    const auto file = smal::tensors::SafeTensors::open(path);
    return load_net(file, checkpoint_config(file), asset(), {});
  }

  std::string refusal(const Tensors& tensors) const {
    try {
      load(write(tensors));
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  static const smal::tensors::SmalAsset& asset() {
    static const smal::tensors::SmalAsset loaded = testing::load_parity_asset(testing::parity_dir());
    return loaded;
  }

  testing::ScratchDir scratch_;
  std::filesystem::path good_ = scratch_.path() / "good.safetensors";
  PrimaConfig config_ = named_config("tiny");
  Tensors tensors_;
};

TEST_F(Checkpoint, LoadedWeightsAreTheFilesWeights) {
  const auto net = load(good_);
  EXPECT_EQ(net->config(), config_);
  const auto parameters = net->named_parameters();
  EXPECT_EQ(parameters.size(), tensors_.size());
  for (const auto& parameter : parameters) {
    EXPECT_TRUE(torch::equal(parameter.value(), tensors_.at(parameter.key()))) << parameter.key();
  }
}

TEST_F(Checkpoint, EveryFaultIsNamedAtOnce) {
  tensors_.erase("backbone.cls_token");
  tensors_.erase("smal_head.decpose.2.bias");
  tensors_["smal_head.stray"] = torch::zeros({3});
  tensors_["smal_head.init_cam"] = torch::zeros({1, 4});
  tensors_["backbone.last_norm.bias"] = torch::zeros({config_.embed_dim}, torch::kInt32);
  const std::string message = refusal(tensors_);
  EXPECT_TRUE(mentions(message, "changed.safetensors")) << message;
  EXPECT_TRUE(mentions(message, "5 faults")) << message;
  EXPECT_TRUE(mentions(message, "backbone.cls_token: missing")) << message;
  EXPECT_TRUE(mentions(message, "smal_head.decpose.2.bias: missing")) << message;
  EXPECT_TRUE(mentions(message, "smal_head.stray: not part")) << message;
  EXPECT_TRUE(mentions(message, "smal_head.init_cam: shape [1, 4], expected [1, 3]")) << message;
  EXPECT_TRUE(mentions(message, "backbone.last_norm.bias: dtype Int")) << message;
}

TEST_F(Checkpoint, WeightsThatAreNotFiniteAreRefusedByName) {
  for (const auto dtype : {torch::kFloat32, torch::kBFloat16}) {
    for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
      Tensors broken = tensors_;
      torch::Tensor& tensor = broken.at("smal_head.decpose.2.bias");
      tensor = tensor.clone().to(dtype);
      tensor.view({-1})[-1] = value;
      EXPECT_TRUE(mentions(refusal(broken), "smal_head.decpose.2.bias holds NaN or infinity")) << value;
    }
  }
}

TEST_F(Checkpoint, TheConfigsSizesMustBeTheWeights) {
  const std::filesystem::path path = scratch_.path() / "deeper.safetensors";
  PrimaConfig deeper = config_;
  deeper.depth = 3;
  write_checkpoint(path, deeper, {tensors_.begin(), tensors_.end()});
  EXPECT_THROW(load(path), std::runtime_error);
}

TEST_F(Checkpoint, AllowedExtrasAreLeftOut) {
  for (const char* name :
       {"bioclip_embedding.species_model.transformer.resblocks.0.ln_1.weight",
        "bioclip_embedding.species_model.token_embedding.weight",
        "bioclip_embedding.species_model.positional_embedding", "discriminator.D_conv1.weight",
        "shape_prior_loss.betas_prec", "pose_prior_loss.precs", "initialized"}) {
    tensors_[name] = torch::zeros({2});
  }
  tensors_["smal.v_template"] = torch::zeros_like(asset().v_template);
  EXPECT_EQ(refusal(tensors_), "");
}

TEST_F(Checkpoint, BodyBuffersMustHaveTheAssetsShapes) {
  tensors_["smal.v_template"] = torch::zeros({100, 3});
  EXPECT_TRUE(mentions(refusal(tensors_), "smal.v_template: shape [100, 3], expected [3889, 3]"));
}

TEST_F(Checkpoint, HalfPrecisionFilesAreCast) {
  for (const auto dtype : {torch::kFloat16, torch::kBFloat16}) {
    const std::filesystem::path path = scratch_.path() / "half.safetensors";
    write_initial_checkpoint(path, config_, 7, dtype);
    for (const auto& parameter : load(path)->named_parameters()) {
      EXPECT_EQ(parameter.value().scalar_type(), torch::kFloat32);
      const torch::Tensor expected = tensors_.at(parameter.key()).to(dtype).to(torch::kFloat32);
      EXPECT_TRUE(torch::equal(parameter.value(), expected)) << parameter.key();
    }
  }
}

TEST_F(Checkpoint, FilesWithoutSizesAreRefused) {
  const std::filesystem::path path = scratch_.path() / "bare.safetensors";
  smal::tensors::write_safetensors(path, {{"x", torch::zeros({1})}});
  EXPECT_THROW(checkpoint_config(smal::tensors::SafeTensors::open(path)), std::runtime_error);
  smal::tensors::write_safetensors(path, {{"x", torch::zeros({1})}}, {{"prima_config", "{\"depht\": 2}"}});
  try {
    checkpoint_config(smal::tensors::SafeTensors::open(path));
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_TRUE(mentions(error.what(), "did you mean 'depth'")) << error.what();
  }
}

TEST_F(Checkpoint, ASeedAlwaysGivesTheSameBytes) {
  const std::filesystem::path again = scratch_.path() / "again.safetensors";
  write_initial_checkpoint(again, config_, 7);
  EXPECT_EQ(bytes_of(again), bytes_of(good_));
  write_initial_checkpoint(again, config_, 8);
  EXPECT_NE(bytes_of(again), bytes_of(good_));
}

TEST_F(Checkpoint, InitialPoseStandsUprightAndCameraIsTheOfficialOne) {
  const torch::Tensor pose = tensors_.at("smal_head.init_pose").view({35, 6});
  const torch::Tensor identity = torch::tensor({1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F});
  EXPECT_TRUE(torch::equal(pose.narrow(0, 1, 34), identity.expand({34, 6})));
  const torch::Tensor upright = torch::tensor({1.0F, 0.0F, 0.0F, 0.0F, -1.0F, 0.0F});  // half a turn about x
  EXPECT_TRUE(torch::equal(pose[0], upright));
  EXPECT_TRUE(torch::equal(tensors_.at("smal_head.init_cam"), torch::tensor({{0.9F, 0.0F, 0.0F}})));
  EXPECT_TRUE(torch::equal(tensors_.at("backbone.last_norm.weight"), torch::ones({config_.embed_dim})));
  EXPECT_TRUE(torch::equal(tensors_.at("smal_head.param_to_token.1.bias"), torch::zeros({config_.dec_dim})));
}

TEST_F(Checkpoint, InitialSpreadFollowsTheFanIn) {
  const torch::Tensor weight = tensors_.at("backbone.blocks.0.mlp.fc2.weight");  // 256 inputs
  EXPECT_NEAR(weight.std().item<double>(), 1.0 / (16.0 * std::sqrt(3.0)), 0.001);
  EXPECT_NEAR(weight.mean().item<double>(), 0.0, 0.002);
  EXPECT_NEAR(tensors_.at("smal_head.keypoint_2d_embeddings.weight").std().item<double>(), 0.02, 0.001);
}

// The checkpoint that the authors released, by names and shapes: a full-size network holds exactly its
// tensors, but for the extras that need not be loaded.
TEST(OfficialNames, FullSizeNetworkHasThemAll) {
  std::ifstream stream(testing::data_dir() / "official_state_dict.json");
  const auto official = nlohmann::json::parse(stream);
  ASSERT_EQ(official.size(), 955U);
  std::map<std::string, std::vector<std::int64_t>> required, ours;
  for (const auto& [name, entry] : official.items()) {
    if (!is_allowed_extra(name)) required[name] = entry.at("shape").get<std::vector<std::int64_t>>();
  }
  std::int64_t total = 0;
  for (const TensorSpec& spec : expected_tensors(named_config("vith"))) {
    ours[spec.name] = spec.shape;
    total += torch::empty(spec.shape, torch::kMeta).numel();
  }
  EXPECT_EQ(ours, required);
  // ViT-H 630,913,280 + BioCLIP's visual tower 86,192,640 + head 168,198,785 + the bio token's projection.
  EXPECT_EQ(total, 630'913'280 + 86'192'640 + 168'198'785 + (512 + 1) * 1280 + 2 * 1280);
}

TEST(OfficialNames, SmallFitsTwelveMegabytesInHalfPrecision) {
  std::int64_t total = 0;
  for (const TensorSpec& spec : expected_tensors(named_config("small"))) {
    total += torch::empty(spec.shape, torch::kMeta).numel();
  }
  EXPECT_GT(total, 1'000'000);                 // the sum is not empty
  EXPECT_LT(2 * total, 12'000'000 - 100'000);  // the header takes some 60 kB
}

}  // namespace
}  // namespace q3d::model
