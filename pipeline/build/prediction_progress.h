// The progress of a run that predicts whole units. It advances after each batch.
#pragma once

#include <cstdint>
#include <utility>

#include "pipeline/run/progress.h"
#include "pipeline/unit/step_observer.h"

namespace q3d::pipeline::build {

class PredictionProgress : public unit::StepObserver {
 public:
  // `progress` counts candidates and must outlive this object.
  explicit PredictionProgress(run::Progress& progress) : progress_(progress) {}

  void predicted(const unit::UnitWork& /*work*/, std::size_t /*position*/,
                 const unit::PredictedSample& /*sample*/) override {
    ++fresh_;
  }
  void batch_done(const unit::UnitWork& /*work*/, std::string_view /*step*/, std::size_t /*done*/,
                  std::size_t /*total*/) override {
    tell();
  }
  // Call this after each unit, which may have had no batch.
  void tell() { progress_.advance(std::exchange(fresh_, 0)); }

 private:
  run::Progress& progress_;
  std::int64_t fresh_ = 0;
};

}  // namespace q3d::pipeline::build
