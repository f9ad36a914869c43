// Speed of prediction and of test-time adaptation. Names read <what>/<size>/<dtype>/<batch>, for instance
//   model_bench --benchmark_filter='/small/'
//   OMP_NUM_THREADS=2 model_bench --benchmark_filter='/vith/bfloat16/'
// "items" are images for Predict, and iterations times images for Adapt. peak_GB is the process's largest
// resident size up to then. Weights are seeded, the body is the synthetic quadruped, the device is `auto`.
#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <memory>
#include <string>
#include <vector>

#include "model/device.h"
#include "model/init.h"
#include "model/net.h"
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

[[maybe_unused]] const bool kRegistered = [] {
  for (const std::string size : {"small", "vith"}) {
    for (const auto& [dtype, name] :
         {std::pair{torch::kFloat32, "float32"}, {torch::kBFloat16, "bfloat16"}}) {
      const Setting setting{size, dtype};
      for (const auto& [what, run] : {std::pair{"Predict", &predict}, {"Adapt", &adapt_instances}}) {
        benchmark::RegisterBenchmark((std::string(what) + "/" + size + "/" + name).c_str(),
                                     [setting, run = run](benchmark::State& state) { run(state, setting); })
            ->Arg(1)
            ->Arg(4)
            ->Arg(8)
            ->Unit(benchmark::kMillisecond)
            ->UseRealTime();
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace q3d::model
