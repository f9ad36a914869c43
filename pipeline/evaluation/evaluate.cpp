#include "pipeline/evaluation/evaluate.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <memory>
#include <utility>

#include "manifests/digest.h"
#include "pipeline/build/rank_share.h"
#include "pipeline/build/workspace.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/evaluation/evaluation_parts.h"
#include "pipeline/evaluation/evaluator.h"
#include "pipeline/evaluation/hidden_truth.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_store.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::SampleRecord;

// Returns every n-th record, so that a quick run covers the whole file.
std::vector<SampleRecord> evenly_spaced(std::vector<SampleRecord> records, std::int64_t limit) {
  const auto wanted = static_cast<std::size_t>(limit);
  if (limit <= 0 || wanted >= records.size()) return records;
  std::vector<SampleRecord> some;
  for (std::size_t i = 0; i < wanted; ++i) some.push_back(std::move(records[i * records.size() / wanted]));
  return some;
}

DatasetResult load(const EvaluatedDataset& dataset, std::int64_t limit, manifests::DigestCache& digests,
                   Pool& pool) {
  const config::DatasetConfig& source = dataset.source;
  DatasetResult result;
  auto [read, annotations_sha256] = candidates::read_dataset(source, digests);
  result.name = source.name + "/" + source.split;
  result.annotations_sha256 = std::move(annotations_sha256);
  result.is_rendered = candidates::is_rendered(source.root);
  for (auto& note : read.notes) result.notes.push_back(std::move(note.text));
  result.listed = static_cast<std::int64_t>(read.records.size());
  if (!dataset.truth.empty()) {
    result.truth_sha256 = manifests::sha256_file(dataset.truth);
    const std::size_t without = HiddenTruth(dataset.truth, dataset.masks).complete(read.records);
    if (without > 0) {
      result.notes.push_back(
          fmt::format("{} of {} samples are not in the truth file", without, read.records.size()));
    }
  }
  const std::size_t before = pool.candidates.size();
  append(evenly_spaced(std::move(read.records), limit), digests, pool);
  result.samples.resize(pool.candidates.size() - before);
  return result;
}

Evaluation described(const EvaluationConfig& config, const EvaluationOptions& options, const Plan& plan) {
  Evaluation evaluation;
  evaluation.options = options;
  evaluation.config = config.as_written;
  evaluation.settings = plan.settings;
  evaluation.checkpoint = config.network.checkpoint.filename().string();
  evaluation.checkpoint_sha256 = manifests::sha256_file(config.network.checkpoint);
  evaluation.smal_asset_sha256 = manifests::sha256_file(config.network.smal_asset);
  evaluation.device_key = network::device_key(config.network);
  return evaluation;
}

// Network and bodies, which live on the device's thread.
struct Machinery {
  explicit Machinery(const EvaluationConfig& config) {
    device.run([&] {
      network = network::load_network(config.network, config.tta, config.priors);
      meshes = network::load_body_meshes(config.network.smal_asset);
    });
  }
  std::unique_ptr<device::Network> network;
  std::unique_ptr<device::BodyMeshes> meshes;
  device::DeviceWorker device;  // the last member: it ends before the objects that its jobs use
};

// Lets the ranks share the units. Afterwards, in rank 0, the store holds the results of all ranks.
void evaluate_with_ranks(Evaluator& evaluator, Machinery& machinery, stages::StageStore& store,
                         std::int64_t samples, build::RankShare& ranks) {
  run::Progress progress("evaluated", samples, ranks.options().quiet);
  ranks.make(evaluator.flow(progress), machinery.device, progress);
  if (ranks.leads()) store.take_over_ranks();
}

// Returns the results of all samples in rank 0, and nothing in the others.
std::vector<SampleResult> evaluate_pool(const Pool& pool, const Instruments& instruments,
                                        Machinery& machinery, const std::filesystem::path& parts,
                                        const std::string& key, build::RankShare& ranks) {
  const auto open = [&] {
    return std::make_unique<stages::StageStore>(parts, "evaluate", key, &candidates::Unit::input_digest,
                                                ranks.of_store());
  };
  std::unique_ptr<stages::StageStore> store;
  if (ranks.leads()) store = open();  // takes over the results of an earlier run
  const auto samples = static_cast<std::int64_t>(pool.candidates.size());
  if (ranks.is_shared()) {
    ranks.agree(build::key_of_work(key, pool.units), false);
    if (!store) store = open();
    Evaluator evaluator(pool, instruments, *store);
    evaluate_with_ranks(evaluator, machinery, *store, samples, ranks);
    ranks.end();
    if (!ranks.leads()) return {};
  }
  Evaluator evaluator(pool, instruments, *store);
  run::Progress progress("evaluated", samples, ranks.options().quiet || ranks.is_shared());
  unit::run_units(evaluator.flow(progress), machinery.device);
  return evaluator.take_results();
}

// The same for a rank other than 0. Rank 0 may have ended already if other ranks made the last units too;
// this is no error if it has completed the evaluation, which removes the parts.
void evaluate_beside_leader(const Pool& pool, const Instruments& instruments, Machinery& machinery,
                            const std::filesystem::path& parts, const std::string& key,
                            build::RankShare& ranks) {
  try {
    evaluate_pool(pool, instruments, machinery, parts, key, ranks);
  } catch (const build::LeaderLost&) {
    if (std::filesystem::exists(parts)) throw;
  }
}

// Gives every test set the results of its samples.
void hand_out(std::vector<SampleResult>&& results, std::vector<DatasetResult>& datasets) {
  auto next = std::make_move_iterator(results.begin());
  for (DatasetResult& dataset : datasets) {
    const auto end = next + static_cast<std::ptrdiff_t>(dataset.samples.size());
    std::copy(next, end, dataset.samples.begin());
    next = end;
  }
}

}  // namespace

void evaluate(const EvaluationConfig& config, const EvaluationOptions& options,
              const std::function<void(const Evaluation&)>& write) {
  const auto start = std::chrono::steady_clock::now();
  run::RunOptions in_parts = options.run;
  in_parts.out = EvaluationParts::folder_in(options.run.out);
  build::RankShare ranks(&config.network, in_parts, "evaluate");
  EvaluationConfig own = config;
  own.network = ranks.own(config.network);
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    build::flow_threads(ranks.options().threads));
  const Plan plan = plan_settings(options.settings);
  Evaluation evaluation = described(own, options, plan);
  if (!ranks.await_digests()) return;
  EvaluationParts parts(options.run.out, ranks.leads());
  Pool pool;
  for (const EvaluatedDataset& dataset : config.datasets) {
    evaluation.datasets.push_back(load(dataset, options.limit, parts.digests(), pool));
  }
  if (ranks.leads()) parts.digests().save();
  ranks.tell_digests();
  Machinery machinery(own);
  evaluation.device = machinery.network->device_description();
  evaluation.device_warning = machinery.network->device_warning();
  const Instruments instruments{&plan, machinery.meshes.get(), machinery.network.get(), options.seed};
  const std::string key = key_of_results(own, plan, evaluation);
  if (!ranks.leads()) {
    evaluate_beside_leader(pool, instruments, machinery, parts.folder(), key, ranks);
    return;
  }
  hand_out(evaluate_pool(pool, instruments, machinery, parts.folder(), key, ranks), evaluation.datasets);
  evaluation.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  write(evaluation);
  parts.remove();
}

}  // namespace q3d::pipeline::evaluation
