// Runs test sets through the network, unit by unit: decode, predict, adapt, measure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "pipeline/candidates/candidate.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/device/device_worker.h"
#include "pipeline/evaluation/evaluate.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/unit_flow.h"

namespace q3d::pipeline::evaluation {

// The inputs that measuring needs and does not change.
struct Instruments {
  const Plan* plan = nullptr;
  const device::BodyMeshes* meshes = nullptr;
  device::Network* network = nullptr;  // called on the device's thread only
  std::uint64_t seed = 0;
};

// The samples of all test sets, end to end.
struct Pool {
  std::vector<candidates::Candidate> candidates;
  std::vector<candidates::Unit> units;  // a unit has samples of one test set
};

// Appends the samples of a test set. A record that a loader failed keeps its failure, except
// no_visible_keypoints, because such a record still has 3D metrics. Pictures are digested. Throws
// manifests::IoError and Interrupted.
void append(std::vector<manifests::SampleRecord> records, manifests::DigestCache& digests, Pool& pool);

class Evaluator {
 public:
  // All references must outlive this object.
  Evaluator(const Pool& pool, const Instruments& instruments, stages::StageStore& store);

  // Returns a flow over the pool's units. It measures a unit and saves it in the store, or loads it from
  // there. It advances `progress` by the samples of each unit.
  unit::UnitFlow flow(run::Progress& progress);
  // Returns the results of the units that the flow has had, in the order of the pool.
  std::vector<SampleResult> take_results() { return std::move(results_); }

 private:
  struct Measurable;
  bool load(const candidates::Unit& unit);
  static void decode(unit::UnitWork& work);
  void compute(const unit::UnitWork& work);
  Measurable predict(const unit::UnitWork& work);
  std::size_t adapt(const TtaPass& pass, std::size_t setting, const Measurable& unit);
  void measure_setting(std::size_t setting, std::span<const device::BodyPrediction> bodies,
                       const Measurable& unit);
  std::span<SampleResult> results_of(const candidates::Unit& unit);

  const Pool& pool_;
  const Instruments& instruments_;
  stages::StageStore& store_;
  std::vector<SampleResult> results_;
};

}  // namespace q3d::pipeline::evaluation
