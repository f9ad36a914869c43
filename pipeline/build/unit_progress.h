// Shows the progress of a build: how many candidates have their verdict, the counts of the verdicts, and the
// current step of the current unit.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <string>

#include "manifests/verdict.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/run/progress.h"
#include "pipeline/unit/step_observer.h"

namespace q3d::pipeline::build {

// The results that a run makes and that decide verdicts.
struct VerdictSteps {
  bool judges = true;  // false in a run that only predicts
  bool refines = true;
  bool measures = true;  // guards and trust may drop what the rule keeps
};

// A candidate counts as done when no later step of the run can change its verdict: a failed or discarded one
// after its prediction, an adapted one after its adaptation, and a label that is measured after that. So the
// bar moves after each batch, and the counts of the verdicts add up to the number of candidates done. All
// functions but others() are called on the device's thread only.
class UnitProgress : public unit::StepObserver {
 public:
  UnitProgress(const config::JudgingRules& rules, VerdictSteps steps, std::int64_t candidates,
               std::int64_t units, bool quiet);

  void predicted(const unit::UnitWork& work, std::size_t position,
                 const unit::PredictedSample& sample) override;
  void refined(const unit::UnitWork& work, const unit::RefinedSample& sample) override;
  void batch_done(const unit::UnitWork& work, std::string_view step, std::size_t done,
                  std::size_t total) override;

  // Counts the unit by its final judgements. `from_earlier_run` says that nothing of it was computed in this
  // run.
  void finish(const unit::UnitWork& work, bool from_earlier_run);

  using Counts = std::array<std::int64_t, 4>;  // by manifests::Verdict
  // Sets the counts of the units that other processes have finished so far. May be called on any thread.
  void others(const Counts& counts);
  static Counts counts_of(const unit::UnitWork& work);

 private:
  void count(manifests::Judgement judgement, const candidates::Candidate& candidate);
  void tell(std::int64_t count, bool from_earlier_run, const std::string& step);

  const config::JudgingRules& rules_;
  VerdictSteps steps_;
  std::int64_t units_;
  std::mutex mutex_;       // guards the members below
  Counts others_{};        // of the units of other processes
  Counts finished_{};      // of the finished units
  Counts present_{};       // of the current unit so far
  std::int64_t told_ = 0;  // candidates of the current unit that progress_ counts as done
  std::string step_;       // step of the current unit
  run::Progress progress_;
};

}  // namespace q3d::pipeline::build
