// Measures what a trained network knows on pictures that training has not seen. `build` and `calibrate`
// compare a pool with the result (pipeline/device/domain.h).
#pragma once

#include <memory>

#include "model/net.h"
#include "pipeline/device/domain.h"
#include "pipeline/feed/feed.h"
#include "pipeline/training/settings/training_config.h"
#include "smal/tensors/body.h"

namespace q3d::pipeline::training {

// Predicts draws of the feed, which must not augment, batch by batch until there are `config.samples` of
// them, and returns the quantiles of their L_proj (crop units) with the config's texts about the pictures. A
// draw without a visible keypoint has no L_proj and is left out. Leaves the network in evaluation mode.
// Throws std::runtime_error if no draw has an L_proj, and if one is not finite.
device::NetworkDomain measure_domain(const settings::DomainConfig& config,
                                     const std::shared_ptr<model::PrimaNet>& net,
                                     const smal::tensors::SmalBody& body, const feed::Feed& feed);

}  // namespace q3d::pipeline::training
