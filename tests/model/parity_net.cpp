#include "tests/model/parity_net.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "model/device.h"
#include "model/net.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::testing {
namespace {

void move_weights(const model::Prima& prima, std::uint64_t seed) {
  const at::NoGradGuard no_grad;
  auto generator = torch::make_generator<torch::CPUGeneratorImpl>(seed);
  for (auto& weight : prima.net().parameters()) {
    const torch::Tensor part = torch::rand(weight.sizes(), generator, torch::kFloat64) * 2.0 - 1.0;
    weight.mul_(1.0 + kFloat32Rounding * part);
  }
}

torch::Tensor largest_change(const torch::Tensor& tensor, const torch::Tensor& exact) {
  const torch::Tensor change = (tensor - exact).detach().abs();
  const bool are_rotations = change.dim() >= 3 && change.size(-1) == 3 && change.size(-2) == 3;
  return are_rotations ? change.amax({-2, -1}, /*keepdim=*/true) : change.max();
}

}  // namespace

smal::tensors::SafeTensors parity_file(const std::string& name) {
  return smal::tensors::SafeTensors::open(parity_dir() / (name + ".safetensors"));
}

model::PrimaConfig parity_config(const std::string& which) {
  const std::filesystem::path path = parity_dir() / ("weights_" + which + ".json");
  std::ifstream stream(path);
  if (!stream) throw std::runtime_error(path.string() + ": cannot open");
  const nlohmann::json meta = nlohmann::json::parse(stream).at("meta");
  const nlohmann::json& sizes = meta.at("config");
  const smal::tensors::SafeTensors weights = parity_file("weights_" + which);
  const auto rows = [&](const std::string& name) { return weights.tensor(name).size(0); };

  model::PrimaConfig config;
  config.embed_dim = sizes.at("embed_dim");
  config.depth = sizes.at("depth");
  config.heads = sizes.at("heads");
  config.mlp_ratio = rows("backbone.blocks.0.mlp.fc1.weight") / config.embed_dim;
  config.clip_width = sizes.at("clip_width");
  config.clip_layers = sizes.at("clip_layers");
  config.clip_heads = meta.at("clip_heads");
  config.clip_out = sizes.at("clip_out");
  config.dec_dim = sizes.at("dec_dim");
  config.dec_layers = sizes.at("dec_layers");
  config.dec_heads = sizes.at("dec_heads");
  config.dec_ffn = rows("smal_head.layers.0.ffn.0.weight");
  config.ief_iterations = sizes.at("ief");
  config.focal_px = parity_file("forward_" + which).tensor("focal_length")[0][0].item<double>();
  return config;
}

model::Prima parity_prima(const std::string& which, torch::ScalarType dtype) {
  return parity_prima(which, parity_config(which), dtype);
}

model::Prima parity_prima(const std::string& which, const model::PrimaConfig& config,
                          torch::ScalarType dtype) {
  model::Prima prima = learning_parity_prima(which, config, dtype);
  prima.net().pack();
  return prima;
}

model::Prima learning_parity_prima(const std::string& which, const model::PrimaConfig& config,
                                   torch::ScalarType dtype) {
  model::configure_compute(1);  // a network this small only loses time to a second thread
  const smal::tensors::SmalAsset asset = load_parity_asset(parity_dir());
  auto net = model::load_net(parity_file("weights_" + which), config, asset, {torch::kCPU, dtype});
  net->eval();
  for (auto& parameter : net->parameters()) parameter.set_requires_grad(false);
  return {net, smal::tensors::SmalBody(asset).to_dtype(dtype)};
}

torch::Tensor parity_images(const model::Prima& prima, const torch::Tensor& index) {
  const torch::Tensor crops = parity_file("inputs").tensor("images_u8");
  return prima.normalise(crops.index_select(0, index.to(torch::kInt64)));
}

TensorMap float32_noise(const std::string& which, const model::PrimaConfig& config,
                        const std::function<TensorMap(const model::Prima&)>& compute) {
  constexpr std::uint64_t kRuns = 4;
  const TensorMap exact = compute(parity_prima(which, config, torch::kFloat64));
  TensorMap noise;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const model::Prima moved = parity_prima(which, config, torch::kFloat64);
    move_weights(moved, seed);
    for (const auto& [name, tensor] : compute(moved)) {
      const torch::Tensor change = largest_change(tensor, exact.at(name));
      const auto known = noise.find(name);
      noise[name] = known == noise.end() ? change : torch::maximum(known->second, change);
    }
  }
  return noise;
}

torch::Tensor few_roundings(const torch::Tensor& tensor) {
  return 4.0 * kFloat32Rounding * tensor.to(torch::kFloat64).abs().max();
}

void expect_close(const std::string& name, const torch::Tensor& got, const torch::Tensor& expected,
                  double tolerance) {
  expect_close(name, got, expected, torch::tensor(tolerance, torch::kFloat64));
}

void expect_close(const std::string& name, const torch::Tensor& got, const torch::Tensor& expected,
                  const torch::Tensor& tolerance) {
  SCOPED_TRACE(name);
  ASSERT_TRUE(got.defined());
  ASSERT_EQ(got.sizes(), expected.sizes());
  ASSERT_TRUE(got.isfinite().all().item<bool>());
  const torch::Tensor error = (got.to(torch::kFloat64) - expected.to(torch::kFloat64)).abs();
  const torch::Tensor share = error / tolerance;
  const std::int64_t worst = share.argmax().item<std::int64_t>();
  EXPECT_LE(share.max().item<double>(), 1.0)
      << "difference " << error.flatten()[worst].item<double>() << " at element " << worst << ", tolerance "
      << tolerance.expand(error.sizes()).flatten()[worst].item<double>();
}

}  // namespace q3d::testing
