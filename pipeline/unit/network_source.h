// The steps of a unit get the network from a NetworkSource.
#pragma once

#include <functional>

#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// Returns the network, which is loaded at the first call, because a unit without pseudo labels needs none.
using NetworkSource = std::function<device::Network&()>;

}  // namespace q3d::pipeline::unit
