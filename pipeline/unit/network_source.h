// The steps of a unit get the network from a source.
#pragma once

#include <functional>

#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// Returns the network, and loads it at the first call: a unit without pseudo labels needs none.
using NetworkSource = std::function<device::Network&()>;

}  // namespace q3d::pipeline::unit
