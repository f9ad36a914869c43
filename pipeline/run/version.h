// The version of the toolkit.
#pragma once

#include <string_view>

namespace q3d::pipeline::run {

std::string_view version();  // "0.2.0"

}  // namespace q3d::pipeline::run
