#include "pipeline/evaluation/evaluate.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>

#include "manifests/digest.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/evaluation/dataset_evaluator.h"
#include "pipeline/evaluation/hidden_truth.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::SampleRecord;

struct LoadedDataset {
  DatasetResult result;  // without samples
  std::vector<SampleRecord> records;
};

// Returns every n-th record, so that a quick run covers the whole file.
std::vector<SampleRecord> evenly_spaced(std::vector<SampleRecord> records, std::int64_t limit) {
  const auto wanted = static_cast<std::size_t>(limit);
  if (limit <= 0 || wanted >= records.size()) return records;
  std::vector<SampleRecord> some;
  for (std::size_t i = 0; i < wanted; ++i) some.push_back(std::move(records[i * records.size() / wanted]));
  return some;
}

LoadedDataset load(const EvaluatedDataset& dataset, std::int64_t limit) {
  const config::DatasetConfig& source = dataset.source;
  LoadedDataset loaded;
  manifests::DigestCache digests{{}};  // has no file: an evaluation writes only its own results
  auto [read, annotations_sha256] = candidates::read_dataset(source, digests);
  loaded.result.name = source.name + "/" + source.split;
  loaded.result.annotations_sha256 = std::move(annotations_sha256);
  loaded.result.is_rendered = candidates::is_rendered(source.root);
  for (auto& note : read.notes) loaded.result.notes.push_back(std::move(note.text));
  loaded.result.listed = static_cast<std::int64_t>(read.records.size());
  if (!dataset.truth.empty()) {
    loaded.result.truth_sha256 = manifests::sha256_file(dataset.truth);
    const std::size_t without = HiddenTruth(dataset.truth, dataset.masks).complete(read.records);
    if (without > 0) {
      loaded.result.notes.push_back(
          fmt::format("{} of {} samples are not in the truth file", without, read.records.size()));
    }
  }
  loaded.records = evenly_spaced(std::move(read.records), limit);
  return loaded;
}

std::size_t flow_threads(int wanted) {
  if (wanted > 0) return static_cast<std::size_t>(wanted);
  return std::max<std::size_t>(1, std::thread::hardware_concurrency());
}

}  // namespace

Evaluation evaluate(const EvaluationConfig& config, const EvaluationOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    flow_threads(options.threads));
  const Plan plan = plan_settings(options.settings);
  Evaluation evaluation;
  evaluation.options = options;
  evaluation.config = config.as_written;
  evaluation.settings = plan.settings;
  evaluation.checkpoint = config.network.checkpoint.filename().string();
  evaluation.checkpoint_sha256 = manifests::sha256_file(config.network.checkpoint);
  evaluation.smal_asset_sha256 = manifests::sha256_file(config.network.smal_asset);
  evaluation.device_key = network::device_key(config.network);

  std::vector<LoadedDataset> loaded;
  std::int64_t total = 0;
  for (const EvaluatedDataset& dataset : config.datasets) {
    loaded.push_back(load(dataset, options.limit));
    total += static_cast<std::int64_t>(loaded.back().records.size());
  }

  std::unique_ptr<device::Network> network;
  std::unique_ptr<device::BodyMeshes> meshes;
  device::DeviceWorker device;  // destroyed before the objects that its jobs use
  device.run([&] {
    network = network::load_network(config.network, config.tta, config.priors);
    meshes = network::load_body_meshes(config.network.smal_asset);
  });
  evaluation.device = network->device_description();
  evaluation.device_warning = network->device_warning();
  const Instruments instruments{&plan, meshes.get(), network.get(), &device, options.seed};
  run::Progress progress("evaluated", total, options.quiet);
  for (LoadedDataset& dataset : loaded) {
    DatasetResult& result = evaluation.datasets.emplace_back(std::move(dataset.result));
    result.samples = evaluate_records(std::move(dataset.records), instruments, progress);
  }
  evaluation.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return evaluation;
}

}  // namespace q3d::pipeline::evaluation
