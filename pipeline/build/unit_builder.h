// Takes every unit of a build through its stages, using the results of earlier runs in the stages' folders.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/shard.h"
#include "manifests/verdict.h"
#include "pipeline/build/rank_share.h"
#include "pipeline/build/unit_progress.h"
#include "pipeline/build/workspace.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/dataset/judgement_list.h"
#include "pipeline/stages/stage.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/label_measurer.h"
#include "pipeline/unit/unit_flow.h"

namespace q3d::pipeline::build {

class UnitBuilder {
 public:
  // All references must outlive the builder. `until` is the last stage that it makes. Rank 0 must construct
  // its builder before the others construct theirs. Throws as StageStore.
  UnitBuilder(const config::BuildConfig& config, const config::JudgingRules& rules,
              const stages::StageKeys& keys, stages::Stage until, Workspace& workspace, RankShare& ranks);

  // Makes every unit, or the units of this rank. Rank 0 then takes over the units of the others, and makes
  // those that they left undone. Throws std::runtime_error, manifests::IoError, Interrupted.
  void run();

  // Returns the judgements of every unit, or, in a rank other than 0, of the units that it made. They are
  // final only if `until` is the last stage.
  const dataset::JudgementList& judgements() const { return judgements_; }
  stages::StageStore& shards() { return shards_; }
  std::int64_t crops_encoded() const { return crops_encoded_; }  // by this process

 private:
  unit::UnitFlow flow();
  void collect();
  unit::Watch watch(int batch) { return {&progress_, static_cast<std::size_t>(batch)}; }
  bool makes(stages::Stage stage) const { return stage <= until_; }
  std::shared_ptr<unit::UnitWork> read(std::int64_t index);
  void decode(unit::UnitWork& work);
  void compute(unit::UnitWork& work);
  void judge_and_refine(unit::UnitWork& work, const unit::NetworkSource& network);
  bool was_done(const unit::UnitWork& work) const;
  void write(unit::UnitWork& work);
  void write_unit_shard(unit::UnitWork& work);

  const config::BuildConfig& config_;
  const config::JudgingRules& rules_;
  const stages::StageKeys& keys_;
  stages::Stage until_;
  Workspace& workspace_;
  RankShare& ranks_;
  stages::StageStore predictions_;
  stages::StageStore refinements_;
  stages::StageStore crops_;
  stages::StageStore shards_;
  std::optional<stages::StageStore> measurements_;  // where there are pseudo labels and they are measured
  std::unique_ptr<unit::LabelMeasurer> measurer_;   // made and used on the device's thread
  std::map<std::string, manifests::DatasetTerms> terms_;  // by candidates::dataset_key
  dataset::JudgementList judgements_;
  std::int64_t crops_encoded_ = 0;
  UnitProgress progress_;
};

}  // namespace q3d::pipeline::build
