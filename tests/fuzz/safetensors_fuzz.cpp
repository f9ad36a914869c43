// Weights: every tensor of an accepted file lies in its mapping. The same bytes as a body model, as priors,
// and as a checkpoint that states its sizes.
#include "model/checkpoint.h"
#include "model/priors.h"
#include "smal/tensors/asset.h"
#include "smal/tensors/safetensors.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  static const q3d::fuzz::Scratch scratch;
  const auto path = scratch.write("weights.safetensors", q3d::fuzz::as_text(data, size));
  q3d::fuzz::value_or_refusal(path, [&] {
    const q3d::smal::tensors::SafeTensors file = q3d::smal::tensors::SafeTensors::open(path);
    std::size_t bytes = 0;
    for (const std::string& name : file.names()) {
      const torch::Tensor tensor = file.tensor(name);
      bytes += tensor.nbytes();
      if (tensor.numel() > 0) tensor.contiguous().sum();  // touches every byte
    }
    require(bytes <= size, "tensors take no more than the file");
  });
  q3d::fuzz::value_or_refusal(path, [&] {
    const auto asset = q3d::smal::tensors::load_asset(path);
    for (const auto& group : asset.keypoint_vertices) {
      for (const std::int64_t vertex : group) {
        require(vertex >= 0 && vertex < asset.v_template.size(0), "a keypoint is made of vertices");
      }
    }
  });
  q3d::fuzz::value_or_refusal(
      path, [&] { q3d::model::load_priors(q3d::smal::tensors::SafeTensors::open(path), torch::kCPU); });
  q3d::fuzz::value_or_refusal(
      path, [&] { q3d::model::checkpoint_config(q3d::smal::tensors::SafeTensors::open(path)); });
  return 0;
}
