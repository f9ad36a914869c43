// Stable names of an enum's enumerators, whose values count up one by one.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace q3d::manifests {

// A table of names in the order of the enumerators. A constexpr table does not compile unless it has one name
// for each enumerator.
template <typename Enum, std::size_t N>
class EnumNames {
 public:
  // `what` says in messages what the enum is. `first` and `last` are its first and its last enumerator.
  constexpr EnumNames(std::string_view what, Enum first, Enum last, const std::string_view (&names)[N])
      : what_(what), first_(static_cast<int>(first)) {
    if (static_cast<int>(last) - first_ + 1 != static_cast<int>(N)) {
      throw std::logic_error("an enum needs one name for each enumerator");
    }
    std::copy(std::begin(names), std::end(names), names_.begin());
  }

  // Returns the name of an enumerator. Throws std::out_of_range for a value that is no enumerator.
  std::string_view name(Enum value) const {
    return names_.at(static_cast<std::size_t>(static_cast<int>(value) - first_));
  }

  // Returns the enumerator of this name. Throws std::invalid_argument that lists the names if there is none.
  Enum value(std::string_view name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found != names_.end()) return static_cast<Enum>(found - names_.begin() + first_);
    std::string message("unknown ");
    message.append(what_).append(" \"").append(name).append("\"; known:");
    for (const std::string_view known : names_) message.append(" ").append(known);
    throw std::invalid_argument(message);
  }

  std::span<const std::string_view> all() const { return names_; }

 private:
  std::string_view what_;
  int first_;
  std::array<std::string_view, N> names_{};
};

}  // namespace q3d::manifests
