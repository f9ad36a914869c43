// Weights: every tensor of an accepted file lies in its mapping.
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
  return 0;
}
