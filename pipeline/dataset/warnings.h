// Warnings say why the labels of a dataset may be worth little. dataset.json lists them and `build` prints
// them.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::dataset {

enum class WarningKind : std::uint8_t {
  above_ceiling,     // tau_high is above filter.tau_ceiling
  outside_domain,    // the pool's errors lie far outside those of the network's own pictures
  rendered_network,  // a network that knows only rendered pictures labels photographs
  rendered_body,     // the rendered world's body model stands for animals on photographs
};
std::string_view to_string(WarningKind kind);                 // the enumerator's name
WarningKind warning_kind_from_string(std::string_view name);  // throws std::invalid_argument
std::span<const std::string_view> warning_kind_names();

struct Warning {
  WarningKind kind = WarningKind::outside_domain;
  std::string dataset;  // its name in the config; empty if the warning concerns all datasets
  std::string message;  // a sentence or more for people, with the numbers
  bool operator==(const Warning&) const = default;
};

// Returns a list of {"kind", "dataset", "message"}. The dataset is null for a warning about all of them.
nlohmann::ordered_json to_json(const std::vector<Warning>& warnings);

}  // namespace q3d::pipeline::dataset
