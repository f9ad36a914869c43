// How much memory a training step takes:
//   step_memory [SIZE]        default: vith, which needs 8 GB
// A step needs the weights, as much again for the gradients and twice as much for the optimiser's moments,
// and the activations that the forward pass keeps for the backward pass. The latter are measured here: what
// LibTorch's allocator has given out when the forward pass has ended. A GPU's tensors have the same sizes.
#include <ATen/Parallel.h>
#include <c10/core/Allocator.h>
#include <c10/util/ThreadLocalDebugInfo.h>
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>

#include "model/device.h"
#include "model/init.h"
#include "model/mixed_precision.h"
#include "model/net.h"

namespace q3d::model {
namespace {

constexpr double kMb = 1e6;

// Counts the bytes that this thread's tensors take.
class Counter : public c10::MemoryReportingInfoBase {
 public:
  void reportMemoryUsage(void*, std::int64_t size, std::size_t, std::size_t, c10::Device) override {
    now_ += size;
  }
  bool memoryProfilingEnabled() const override { return true; }
  std::int64_t now() const { return now_; }

 private:
  std::int64_t now_ = 0;
};

// Returns the bytes that a forward pass of so many samples keeps.
std::int64_t kept(PrimaNet& net, std::int64_t samples, bool is_mixed, const Counter& counter) {
  const torch::Tensor images = torch::rand({samples, 3, 256, 256});
  const std::int64_t before = counter.now();
  DecoderOutput output;
  {
    const MixedPrecision mixed(torch::kCPU, is_mixed);
    const ImageFeatures features = net.encode(images);
    const Decoder& decoder = net.decoder();
    output = decoder.refine(decoder.remember(features.image_tokens),
                            decoder.initial_betas(features.bio_token), decoder.own_parameters());
  }
  return counter.now() - before;
}

void measure(const std::string& size) {
  const auto counter = std::make_shared<Counter>();
  const c10::DebugInfoGuard guard(c10::DebugInfoKind::PROFILER_STATE, counter);
  PrimaNet net(named_config(size), Placement{torch::kCPU, torch::kFloat32});
  initialise(net, 1);
  net.train();
  fmt::print("{}: weights {:.0f} MB\n", size, static_cast<double>(counter->now()) / kMb);
  for (const bool is_mixed : {false, true}) {
    for (const bool recomputes : {false, true}) {
      net.recompute_blocks(recomputes);
      const std::int64_t one = kept(net, 1, is_mixed, *counter);
      const std::int64_t three = kept(net, 3, is_mixed, *counter);
      // In bfloat16, the copies of the weights are kept once, whatever the batch.
      fmt::print("{}{}: {:.0f} MB a sample and {:.0f} MB once\n", is_mixed ? "bfloat16" : "float32",
                 recomputes ? ", recompute" : "", static_cast<double>(three - one) / 2 / kMb,
                 static_cast<double>(3 * one - three) / 2 / kMb);
      std::fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace q3d::model

int main(int count, char** arguments) {
  q3d::model::configure_compute(at::get_num_threads());
  q3d::model::measure(count > 1 ? arguments[1] : "vith");
}
