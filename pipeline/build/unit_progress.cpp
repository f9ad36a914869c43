#include "pipeline/build/unit_progress.h"

#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <utility>

#include "filters/fidelity.h"
#include "manifests/enumerators.h"
#include "pipeline/unit/judge.h"
#include "pipeline/unit/prediction_error.h"

namespace q3d::pipeline::build {

UnitProgress::UnitProgress(const config::JudgingRules& rules, VerdictSteps steps, std::int64_t candidates,
                           std::int64_t units, bool quiet)
    : rules_(rules), steps_(steps), units_(units), progress_("candidates", candidates, quiet) {}

void UnitProgress::count(manifests::Judgement judgement, const candidates::Candidate& candidate) {
  unit::apply_exclusion(candidate.exclusion, judgement);
  const bool is_measured = candidate.role == config::Role::pseudo && steps_.measures;
  if (is_measured && manifests::is_kept(judgement.verdict)) return;  // a guard may still drop it
  ++present_.at(static_cast<std::size_t>(judgement.verdict));
}

UnitProgress::Counts UnitProgress::counts_of(const unit::UnitWork& work) {
  Counts counts{};
  for (const manifests::Judgement& judgement : work.judgements)
    ++counts.at(static_cast<std::size_t>(judgement.verdict));
  return counts;
}

void UnitProgress::others(const Counts& counts) {
  const std::lock_guard lock(mutex_);
  const auto sum = [](const Counts& each) {
    return std::accumulate(each.begin(), each.end(), std::int64_t{0});
  };
  const std::int64_t fresh = sum(counts) - sum(others_);
  others_ = counts;
  if (fresh != 0) tell(fresh, false, step_);
}

void UnitProgress::predicted(const unit::UnitWork& work, std::size_t position,
                             const unit::PredictedSample& sample) {
  const std::lock_guard lock(mutex_);
  if (!steps_.judges) {
    ++present_.front();
    return;
  }
  const candidates::Candidate& candidate = work.candidates[position];
  const double error = unit::error_of(sample, work.keypoints[position]);
  const bool is_adapted = steps_.refines && candidate.role == config::Role::pseudo && !std::isnan(error) &&
                          filters::is_adapted(error, rules_.of(candidate.record.dataset));
  if (!is_adapted) count(unit::judge_predicted(candidate, sample, error, rules_), candidate);
}

void UnitProgress::refined(const unit::UnitWork& work, const unit::RefinedSample& sample) {
  const std::lock_guard lock(mutex_);
  const candidates::Candidate& candidate = work.candidates[sample.sample];
  count(unit::judge_refined(work.keypoints[sample.sample], work.errors[sample.sample], sample,
                            rules_.of(candidate.record.dataset), rules_.guards),
        candidate);
}

void UnitProgress::batch_done(const unit::UnitWork& work, std::string_view step, std::size_t done,
                              std::size_t total) {
  const std::lock_guard lock(mutex_);
  const std::int64_t settled = std::accumulate(present_.begin(), present_.end(), std::int64_t{0});
  const std::int64_t fresh = settled - std::exchange(told_, settled);
  tell(fresh, false,
       fmt::format("unit {} of {}: {} {} of {}", work.unit->index + 1, units_, step, done, total));
}

void UnitProgress::finish(const unit::UnitWork& work, bool from_earlier_run) {
  const std::lock_guard lock(mutex_);
  present_ = {};
  const Counts counts = counts_of(work);
  for (std::size_t i = 0; i < counts.size(); ++i) finished_[i] += counts[i];
  const auto all = static_cast<std::int64_t>(work.candidates.size());
  tell(all - std::exchange(told_, 0), from_earlier_run,
       fmt::format("unit {} of {} done", work.unit->index + 1, units_));
}

void UnitProgress::tell(std::int64_t count, bool from_earlier_run, const std::string& step) {
  step_ = step;
  if (!steps_.judges) {
    progress_.advance(count, from_earlier_run, step);
    return;
  }
  std::string details;
  for (const std::string_view name : manifests::verdict_names()) {
    const auto verdict = static_cast<std::size_t>(manifests::verdict_from_string(name));
    details +=
        fmt::format("{} {}, ", name, others_.at(verdict) + finished_.at(verdict) + present_.at(verdict));
  }
  progress_.advance(count, from_earlier_run, details + step);
}

}  // namespace q3d::pipeline::build
