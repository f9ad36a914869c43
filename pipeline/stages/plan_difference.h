// Says why two builds have different keys for one stage.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::stages {

// Lists the differences between the inputs of a stage of the second build and those of the first: "tau_low:
// 0.02 -> 0.03". An earlier stage with another key is named ("the stage predict before it"). For `fidelity`,
// which leaves no file, its own differences are listed instead. The list is empty if the keys are equal.
// Throws std::out_of_range if a plan does not have the stage.
std::vector<std::string> differences(const BuildPlan& before, const BuildPlan& after, Stage stage);

// Returns the one of `plans` whose stage differs least from that of `plan`. Among equal ones it is that of
// the version `preferred`, else the last. Returns nothing if no plan has the stage.
std::optional<BuildPlan> nearest_plan(const std::vector<BuildPlan>& plans, const BuildPlan& plan, Stage stage,
                                      const std::string& preferred);

}  // namespace q3d::pipeline::stages
