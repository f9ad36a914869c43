// The step that predicts the bodies of a unit.
#pragma once

#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/network_source.h"
#include "pipeline/unit/step_observer.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Fills work.predicted and work.errors. The candidates of role `pseudo` whose pictures were decoded get the
// network's prediction, in batches inside the unit; a prediction that is not finite is a failed sample. The
// other candidates get the body that their annotation gives, or none. Does nothing if work.predicted is set.
// With `rules`, it keeps in work.features the features of the candidates that these rules adapt.
void predict_unit(UnitWork& work, const NetworkSource& network, const Watch& watch = {},
                  const config::JudgingRules* rules = nullptr);

}  // namespace q3d::pipeline::unit
