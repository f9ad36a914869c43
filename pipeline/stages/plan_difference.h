// Why two builds have different keys for one stage.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::stages {

// Lists where the inputs of a stage of the second build differ from the first's: "tau_low: 0.02 -> 0.03".
// A stage before it whose key differs is named as such ("the stage predict before it"), except `fidelity`,
// whose own differences are listed, since it leaves no file. Empty if the keys are equal. Throws
// std::out_of_range if a plan does not have the stage.
std::vector<std::string> differences(const BuildPlan& before, const BuildPlan& after, Stage stage);

// The one of `plans` whose stage differs least from that of `plan`. Among equals it is the one of the version
// `preferred`, else the last. Nothing if no plan has the stage.
std::optional<BuildPlan> nearest_plan(const std::vector<BuildPlan>& plans, const BuildPlan& plan, Stage stage,
                                      const std::string& preferred);

}  // namespace q3d::pipeline::stages
