// The settings of a training run that are words.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace q3d::pipeline::training::settings {

// The names are listed in the order of the enumerators. Every *_from_string throws std::invalid_argument on
// an unknown name.

// The precision of the forward pass. `automatic` ("auto") chooses the one that suits the device.
enum class Precision : std::uint8_t { automatic, float32, bfloat16 };
std::string_view to_string(Precision precision);
Precision precision_from_string(std::string_view name);
std::span<const std::string_view> precision_names();

// A phase trains either the whole network, or its two image encoders beforehand.
enum class Objective : std::uint8_t { prima, encoders };
std::string_view to_string(Objective objective);
Objective objective_from_string(std::string_view name);
std::span<const std::string_view> objective_names();

// The decay of a phase's learning rate. `linear` reaches zero at the last step.
enum class Decay : std::uint8_t { linear, none };
std::string_view to_string(Decay decay);
Decay decay_from_string(std::string_view name);
std::span<const std::string_view> decay_names();

// The number type in the file of the finished weights.
enum class ModelDtype : std::uint8_t { float32, float16 };
std::string_view to_string(ModelDtype dtype);
ModelDtype model_dtype_from_string(std::string_view name);
std::span<const std::string_view> model_dtype_names();

}  // namespace q3d::pipeline::training::settings
