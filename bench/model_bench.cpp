// Speed of prediction and of test-time adaptation. Names read <what>/<size>/<dtype>/<batch>, for instance
//   model_bench --benchmark_filter='/small/'
//   OMP_NUM_THREADS=2 model_bench --benchmark_filter='/vith/bfloat16/'
// "items" are images for Predict, and iterations times images for Adapt. CPU time is that of all threads.
// MatrixRate multiplies matrices as the full-size ViT does, by LibTorch's linear and by packed matrices: its
// rate of operations bounds the others. peak_GB is the process's largest resident size up to then. Weights
// are seeded, the body is the synthetic quadruped, the device is `auto`.
#include <ATen/Parallel.h>
#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <memory>
#include <string>
#include <vector>

#include "model/device.h"
#include "model/init.h"
#include "model/net.h"
#include "model/packed_matrix.h"
#include "model/prima.h"
#include "model/tta.h"
#include "pipeline/animal/synthetic_quadruped.h"

namespace q3d::model {
namespace {

using filters::adaptation::Schedule;

constexpr int kAdaptIterations = 10;

struct Setting {
  std::string size;
  torch::ScalarType dtype;
};

// One network at a time: the full-size one takes 3.5 GB.
const Prima& network(const Setting& setting) {
  static std::unique_ptr<Prima> held;
  static std::string held_name;
  const std::string name = setting.size + torch::toString(setting.dtype);
  if (name != held_name) {
    held.reset();
    const torch::Device device = choose_device("auto").device;
    auto net = std::make_shared<PrimaNet>(named_config(setting.size), Placement{device, setting.dtype});
    initialise(*net, 1);
    net->eval();
    for (auto& parameter : net->parameters()) parameter.set_requires_grad(false);
    net->pack();
    held = std::make_unique<Prima>(
        net, smal::tensors::SmalBody(pipeline::animal::make_synthetic_quadruped(), device));
    held_name = name;
  }
  return *held;
}

torch::Tensor crops(std::int64_t batch) {
  at::manual_seed(1);
  return torch::randint(0, 256, {batch, 3, 256, 256}, torch::kUInt8);
}

void report(benchmark::State& state, std::int64_t items) {
  state.SetItemsProcessed(state.iterations() * items);
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  state.counters["peak_GB"] = static_cast<double>(usage.ru_maxrss) / (1 << 20);
}

void predict(benchmark::State& state, const Setting& setting) {
  const Prima& prima = network(setting);
  const std::int64_t batch = state.range(0);
  const torch::Tensor images = crops(batch);
  for (auto _ : state) {
    const Prediction prediction = prima.predict(prima.encode(prima.normalise(images)));
    benchmark::DoNotOptimize(prediction.keypoints_2d.sum().item<float>());
  }
  report(state, batch);
}

void adapt_instances(benchmark::State& state, const Setting& setting) {
  const Prima& prima = network(setting);
  const std::int64_t batch = state.range(0);
  const ImageFeatures features = prima.encode(prima.normalise(crops(batch)));
  const torch::Tensor keypoints =
      torch::cat({torch::rand({batch, 26, 2}) - 0.5, torch::ones({batch, 26, 1})}, 2);
  Schedule schedule;
  schedule.iterations = kAdaptIterations;
  const std::vector<Schedule> schedules(static_cast<std::size_t>(batch), schedule);
  for (auto _ : state) {
    benchmark::DoNotOptimize(adapt(prima, features, keypoints, schedules, {}).best_iteration.data());
  }
  report(state, batch * kAdaptIterations);
}

// The first matrix of the ViT's perceptrons, for 8 pictures of 193 tokens.
void matrix_rate(benchmark::State& state, torch::ScalarType dtype, bool is_packed) {
  constexpr std::int64_t kRows = 8 * 193, kIn = 1280, kOut = 5120;
  configure_compute(at::get_num_threads());
  const at::NoGradGuard no_gradients;
  const torch::Tensor x = torch::rand({kRows, kIn}).to(dtype);
  const torch::Tensor weight = torch::rand({kOut, kIn}).to(dtype);
  const torch::Tensor bias = torch::rand({kOut}).to(dtype);
  if (is_packed && !packs_matrices(torch::kCPU, dtype)) {
    state.SkipWithError("matrices are not packed on this processor");
    return;
  }
  const PackedMatrix packed = is_packed ? PackedMatrix(weight, bias) : PackedMatrix();
  for (auto _ : state) {
    const torch::Tensor product = is_packed ? packed.multiply(x) : torch::linear(x, weight, bias);
    benchmark::DoNotOptimize(product.data_ptr());
  }
  state.counters["flop"] = benchmark::Counter(static_cast<double>(2 * kRows * kIn * kOut),
                                              benchmark::Counter::kIsIterationInvariantRate);
}

[[maybe_unused]] const bool kRegistered = [] {
  for (const std::string size : {"small", "vith"}) {
    for (const auto& [dtype, name] :
         {std::pair{torch::kFloat32, "float32"}, {torch::kBFloat16, "bfloat16"}}) {
      const Setting setting{size, dtype};
      for (const bool is_packed : {false, true}) {
        if (size != "vith") continue;
        const std::string how = is_packed ? "packed" : "linear";
        benchmark::RegisterBenchmark(
            ("MatrixRate/" + how + "/" + name).c_str(),
            [dtype = dtype, is_packed](benchmark::State& state) { matrix_rate(state, dtype, is_packed); })
            ->Unit(benchmark::kMillisecond)
            ->MeasureProcessCPUTime()
            ->UseRealTime();
      }
      for (const auto& [what, run] : {std::pair{"Predict", &predict}, {"Adapt", &adapt_instances}}) {
        benchmark::RegisterBenchmark((std::string(what) + "/" + size + "/" + name).c_str(),
                                     [setting, run = run](benchmark::State& state) { run(state, setting); })
            ->Arg(1)
            ->Arg(4)
            ->Arg(8)
            ->Unit(benchmark::kMillisecond)
            ->MeasureProcessCPUTime()
            ->UseRealTime();
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace q3d::model
