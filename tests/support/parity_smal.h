// Loads the body with which the golden numbers were made.
#pragma once

#include <filesystem>

#include "smal/tensors/asset.h"

namespace q3d::testing {

// Builds the asset of `folder`/smal_asset.safetensors: int8 blend shapes times the scales that
// smal_asset.json states, a sparse joint regressor, and padded skinning rows. Throws std::runtime_error when
// a file or an entry is missing.
smal::tensors::SmalAsset load_parity_asset(const std::filesystem::path& folder);

}  // namespace q3d::testing
