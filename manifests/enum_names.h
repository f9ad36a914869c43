// Stable names of enumerators whose values count up from 0.
#pragma once

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <string_view>

namespace q3d::manifests {

// Returns the enumerator at the position of `name` in `names`. Throws std::invalid_argument that lists the
// names if `name` is not one of them.
template <typename Enum, std::size_t N>
Enum enum_from_name(std::string_view what, std::string_view name,
                    const std::array<std::string_view, N>& names) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<Enum>(found - names.begin());
  std::string message("unknown ");
  message.append(what).append(" \"").append(name).append("\"; known:");
  for (const auto known : names) message.append(" ").append(known);
  throw std::invalid_argument(message);
}

}  // namespace q3d::manifests
