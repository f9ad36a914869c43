#include "pipeline/evaluation/judged_candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <stdexcept>

#include "filters/metrics.h"
#include "manifests/digest.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/evaluation/built_version.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/errors.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using manifests::Reason;
using manifests::Verdict;

// Reads the tables of one stage. It first checks that the folder exists, because opening a store would make
// it.
class StageTables {
 public:
  StageTables(const fs::path& out, const std::string& stage, const std::string& key)
      : folder_(stages::stage_folder(out, stage, key)), store_(opened(out, stage, key)) {}

  manifests::Table load(std::int64_t unit) {
    if (auto table = store_.load_newest(unit)) return std::move(*table);
    fail(unit, "not finished");
  }
  [[noreturn]] void fail(std::int64_t unit, const std::string& what) const {
    throw std::runtime_error(fmt::format("{}: {}; `build` with the same config makes it again",
                                         stages::unit_file(folder_, unit).string(), what));
  }

 private:
  static stages::StageStore opened(const fs::path& out, const std::string& stage, const std::string& key) {
    const fs::path folder = stages::stage_folder(out, stage, key);
    if (!fs::exists(folder)) {
      throw std::runtime_error(fmt::format(
          "{}: the stage's folder is gone; `build` with the same config makes it again", folder.string()));
    }
    return {out, stage, key};
  }

  fs::path folder_;
  stages::StageStore store_;
};

// Returns whether a table belongs to this candidate. A table of a later build over other pictures has other
// ids or another L_proj.
bool is_of(const dataset::VerdictRow& verdict, const manifests::SampleRecord& record,
           const unit::PredictedSample& predicted) {
  constexpr double kRounding = 1e-6;  // another processor may round L_proj differently
  if (record.id != verdict.id) return false;
  const double stated = verdict.judgement.initial_error;
  if (std::isnan(stated)) return true;
  if (predicted.failure != Reason::none) return false;
  const auto error = filters::projection_error(predicted.body.keypoints_2d, unit::crop_keypoints(record));
  return error && std::abs(*error - stated) <= kRounding * stated + kRounding;
}

class PoolReader {
 public:
  PoolReader(const config::BuildConfig& config, const fs::path& out, const stages::StageKeys& keys)
      : unit_size_(static_cast<std::size_t>(config.shards.unit_size)),
        predictions_(out, "predict", keys.predict),
        refinements_(out, "refine", keys.refine) {
    for (const config::DatasetConfig& each : config.datasets) {
      roles_[{each.name, each.split}] = each.role;
    }
  }

  void read(std::span<const dataset::VerdictRow> verdicts, JudgedPool& pool) {
    for (std::size_t first = 0; first < verdicts.size(); first += unit_size_) {
      const std::size_t count = std::min(unit_size_, verdicts.size() - first);
      read_unit(static_cast<std::int64_t>(first / unit_size_), verdicts.subspan(first, count), pool);
    }
  }

 private:
  void read_unit(std::int64_t unit, std::span<const dataset::VerdictRow> verdicts, JudgedPool& pool) {
    const manifests::Table table = predictions_.load(unit);
    const std::vector<unit::PredictedSample> predicted = unit::predicted_from_table(table);
    if (predicted.size() != verdicts.size()) predictions_.fail(unit, "it was made anew for other candidates");
    std::map<std::size_t, device::BodyPrediction> refined;
    for (unit::RefinedSample& sample : unit::refined_from_table(refinements_.load(unit))) {
      refined[sample.sample] = sample.body;
    }
    for (std::size_t i = 0; i < verdicts.size(); ++i) {
      manifests::SampleRecord record = unit::candidate_from_table(table, i);
      if (!is_of(verdicts[i], record, predicted[i])) {
        predictions_.fail(unit, "it was made anew for other candidates or pictures");
      }
      if (roles_.at({verdicts[i].dataset, verdicts[i].split}) != config::Role::pseudo) continue;
      if (predicted[i].failure != Reason::none) {
        ++pool.failed;
        continue;
      }
      pool.candidates.push_back(judged(verdicts[i], std::move(record), predicted[i]));
      if (verdicts[i].judgement.verdict != Verdict::refined) continue;
      const auto body = refined.find(i);
      if (body == refined.end()) refinements_.fail(unit, verdicts[i].id + " is refined and has no body here");
      pool.candidates.back().refined = body->second;
    }
  }

  static JudgedCandidate judged(const dataset::VerdictRow& verdict, manifests::SampleRecord record,
                                const unit::PredictedSample& predicted) {
    JudgedCandidate candidate;
    candidate.record = std::move(record);
    candidate.record.dataset = verdict.dataset;
    candidate.record.split = verdict.split;
    candidate.image_width_px = predicted.image_width_px;
    candidate.image_height_px = predicted.image_height_px;
    candidate.has_mask = predicted.has_mask;
    candidate.verdict = verdict.judgement.verdict;
    candidate.reason = verdict.judgement.reason;
    candidate.predicted = predicted.body;
    return candidate;
  }

  std::size_t unit_size_;
  StageTables predictions_;
  StageTables refinements_;
  std::map<std::pair<std::string, std::string>, config::Role> roles_;  // by dataset and split
};

}  // namespace

const device::BodyPrediction* JudgedCandidate::label() const {
  if (verdict == Verdict::refined) return &*refined;
  return verdict == Verdict::retained ? &predicted : nullptr;
}

JudgedPool read_judged_pool(const config::BuildConfig& config, const fs::path& out) {
  if (!config::needs_network(config)) {
    throw run::ConfigError(
        "no dataset of the config has the role \"pseudo\": there are no pseudo labels to judge");
  }
  manifests::DigestCache digests(out / "digests.txt");
  const stages::StageKeys keys =
      stages::keys_of_config(config, config::judging_rules(config), stages::digest_assets(config, digests),
                             network::device_key(config.network));
  const BuiltVersion version = find_built_version(config, keys, out);
  JudgedPool pool;
  pool.dataset = version.folder.filename().string();
  pool.content_id = version.content_id;
  PoolReader(config, out, keys).read(dataset::PublishedDataset(version.folder).verdicts(), pool);
  return pool;
}

}  // namespace q3d::pipeline::evaluation
