// The flow graph, which reads like the paper's figure of Stage 2.
//
//   read -> decode + crop (parallel) -> predict -> judge -> refine -> judge (device thread)
//        -> encode (parallel) -> write (in order)
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "pipeline/device/device_worker.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

struct UnitFlow {
  std::int64_t units = 0;
  int units_in_flight = 3;  // bounds memory: at most so many units hold decoded pictures
  // Returns the next unit to make, or nothing to end the run. Calls do not overlap. If `claim` is empty, all
  // units are made in order.
  std::function<std::optional<std::int64_t>()> claim;
  // Makes the item of unit i, with the results of an earlier run. Called in the order of the claims, one at a
  // time.
  std::function<std::shared_ptr<UnitWork>(std::int64_t)> read;
  // Called concurrently for several units.
  std::function<void(UnitWork&)> decode;
  // Called on the device thread, one unit at a time.
  std::function<void(UnitWork&)> compute;
  // Called concurrently for several units, after compute. May be empty.
  std::function<void(UnitWork&)> encode;
  // Called in the order of the claims, one at a time.
  std::function<void(UnitWork&)> write;
};

// Runs every unit through the graph. The first exception of any step stops it and is rethrown; Ctrl-C drops
// the units in flight and throws Interrupted.
void run_units(const UnitFlow& flow, device::DeviceWorker& device);

}  // namespace q3d::pipeline::unit
