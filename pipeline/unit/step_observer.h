// An observer is told after each batch of the network how far a unit's step has come, so that progress moves
// within a unit.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// All functions are called on the device's thread.
class StepObserver {
 public:
  StepObserver() = default;
  StepObserver(const StepObserver&) = delete;
  StepObserver& operator=(const StepObserver&) = delete;
  virtual ~StepObserver() = default;

  // Called once for each candidate of the unit, with the prediction of the candidate at `position`.
  virtual void predicted(const UnitWork& /*work*/, std::size_t /*position*/,
                         const PredictedSample& /*sample*/) {}
  // Called once for each candidate that is adapted, with its result. work.predicted is set.
  virtual void refined(const UnitWork& /*work*/, const RefinedSample& /*sample*/) {}
  // Called after a batch, when `done` of the `total` candidates that the step gives to the network are
  // finished.
  virtual void batch_done(const UnitWork& /*work*/, std::string_view /*step*/, std::size_t /*done*/,
                          std::size_t /*total*/) {}
};

// The way in which a step gives a unit's candidates to the network. `batch` must be the batch size that the
// network itself has for the step: then its results have the same bits as those of one call with all
// candidates.
struct Watch {
  StepObserver* observer = nullptr;  // null: all candidates go to the network in one call
  std::size_t batch = 0;

  // Calls step(first, count) for consecutive runs of the `total` candidates.
  template <typename Step>
  void for_each_batch(std::size_t total, Step&& step) const {
    const std::size_t size = observer == nullptr || batch == 0 ? total : batch;
    for (std::size_t first = 0; first < total; first += size) step(first, std::min(size, total - first));
  }
};

}  // namespace q3d::pipeline::unit
