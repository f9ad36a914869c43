// The settings of the network and of adaptation that are words.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace q3d::pipeline::config {

// The number type of the network.
enum class Dtype : std::uint8_t { float32, bfloat16 };
std::string_view to_string(Dtype dtype);
Dtype dtype_from_string(std::string_view name);   // throws std::invalid_argument on an unknown name
std::span<const std::string_view> dtype_names();  // in the order of the enumerators

// The objective that adaptation minimises (model/tta.h).
enum class TtaObjective : std::uint8_t { paper, demo };
std::string_view to_string(TtaObjective objective);
TtaObjective tta_objective_from_string(std::string_view name);  // throws std::invalid_argument
std::span<const std::string_view> tta_objective_names();        // in the order of the enumerators

}  // namespace q3d::pipeline::config
