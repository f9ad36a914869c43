#include "pipeline/evaluation/judged_candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "pipeline/build/publish.h"
#include "pipeline/evaluation/csv.h"
#include "pipeline/run/errors.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using manifests::Reason;
using manifests::Verdict;

struct PublishedVerdict {
  std::string id;
  Verdict verdict = Verdict::failed;
  Reason reason = Reason::none;
};

std::vector<PublishedVerdict> read_verdicts(const fs::path& file) {
  try {
    const std::vector<CsvRow> rows = parse_csv(manifests::read_file(file));
    if (rows.empty()) throw std::invalid_argument("the file is empty");
    const std::size_t id = column_of(rows[0], "id"), verdict = column_of(rows[0], "verdict"),
                      reason = column_of(rows[0], "reason");
    std::vector<PublishedVerdict> verdicts;
    for (std::size_t r = 1; r < rows.size(); ++r) {
      verdicts.push_back({rows[r][id], manifests::verdict_from_string(rows[r][verdict]),
                          manifests::reason_from_string(rows[r][reason])});
    }
    return verdicts;
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

// Opening a store would make its folder.
stages::StageStore open_store(const fs::path& out, const std::string& stage, const std::string& key,
                              const run::Warn& warn) {
  const fs::path folder = stages::stage_folder(out, stage, key);
  if (!fs::exists(folder)) {
    throw std::runtime_error(
        fmt::format("{}: the stage's folder is gone; `build` with the same config makes "
                    "it again",
                    folder.string()));
  }
  return {out, stage, key, warn};
}

manifests::Table load(stages::StageStore& store, const candidates::Unit& unit) {
  if (auto table = store.load(unit)) return std::move(*table);
  throw std::runtime_error(fmt::format("{}: not finished; `build` with the same config makes it again",
                                       store.file(unit).string()));
}

void add_unit(const candidates::Unit& unit, std::span<const candidates::Candidate> candidates,
              std::span<const PublishedVerdict> verdicts, const std::vector<unit::PredictedSample>& predicted,
              const std::vector<unit::RefinedSample>& refined, JudgedPool& pool) {
  std::vector<const device::BodyPrediction*> refined_of(unit.count, nullptr);
  for (const unit::RefinedSample& sample : refined) refined_of.at(sample.sample) = &sample.body;
  for (std::size_t i = 0; i < unit.count; ++i) {
    if (candidates[i].role != config::Role::pseudo) continue;
    if (predicted.at(i).failure != Reason::none) {
      ++pool.failed;
      continue;
    }
    JudgedCandidate& judged = pool.candidates.emplace_back();
    judged.record = candidates[i].record;
    judged.verdict = verdicts[i].verdict;
    judged.reason = verdicts[i].reason;
    judged.predicted = predicted[i].body;
    if (judged.verdict != Verdict::refined) continue;
    if (refined_of[i] == nullptr) {
      throw std::runtime_error(fmt::format("{} is refined and has no refined body", verdicts[i].id));
    }
    judged.refined = *refined_of[i];
  }
}

}  // namespace

const device::BodyPrediction* JudgedCandidate::label() const {
  if (verdict == Verdict::refined) return &*refined;
  return verdict == Verdict::retained ? &predicted : nullptr;
}

JudgedPool read_judged_pool(const config::BuildConfig& config, build::Workspace& workspace) {
  if (!config::needs_network(config)) {
    throw run::ConfigError(
        "no dataset of the config has the role \"pseudo\": there are no pseudo labels to judge");
  }
  const candidates::Ingest& ingest = workspace.ingest();
  const stages::StageKeys keys = stages::stage_keys(config, config::judging_rules(config), ingest,
                                                    workspace.assets(), workspace.device_key());
  const fs::path folder = build::version_folder(workspace.out(), config, keys);
  if (!build::is_published(folder, keys, workspace.digests(), workspace.warn())) {
    throw std::runtime_error(
        fmt::format("{}: there is no finished, sound dataset of this config; run `build` with "
                    "the same config and output folder first",
                    folder.string()));
  }
  const std::vector<PublishedVerdict> verdicts = read_verdicts(folder / "verdicts.csv");
  const bool fits =
      std::equal(verdicts.begin(), verdicts.end(), ingest.candidates.begin(), ingest.candidates.end(),
                 [](const PublishedVerdict& verdict, const candidates::Candidate& each) {
                   return verdict.id == each.record.id;
                 });
  if (!fits) {
    throw std::runtime_error((folder / "verdicts.csv").string() + ": lists other candidates than the config");
  }
  stages::StageStore predictions = open_store(workspace.out(), "predict", keys.predict, workspace.warn());
  stages::StageStore refinements = open_store(workspace.out(), "refine", keys.refine, workspace.warn());
  JudgedPool pool;
  pool.dataset = folder.filename().string();
  pool.content_id = dataset::read_dataset_manifest(folder).content_id;
  for (const candidates::Unit& unit : ingest.units) {
    add_unit(unit, std::span(ingest.candidates).subspan(unit.first, unit.count),
             std::span(verdicts).subspan(unit.first, unit.count),
             unit::predicted_from_table(load(predictions, unit)),
             unit::refined_from_table(load(refinements, unit)), pool);
  }
  return pool;
}

}  // namespace q3d::pipeline::evaluation
