// Reads whole numbers of JSON documents that may be damaged or hostile. nlohmann's get<int>() cuts 2.5 to 2,
// takes true for 1, and returns an arbitrary number for one that is too large.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace q3d::manifests {

// Returns the value. Throws std::runtime_error that says what was found if it is no whole number from `least`
// to `most`.
template <typename Json>
std::int64_t whole_number(const Json& value, std::int64_t least = 0,
                          std::int64_t most = std::numeric_limits<std::int64_t>::max()) {
  const bool is_whole = value.is_number_integer();
  // get<std::int64_t>() would turn an unsigned number beyond the range of int64 into a negative one.
  const bool is_beyond =
      value.is_number_unsigned() && value.template get<std::uint64_t>() >
                                        static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  if (is_whole && !is_beyond) {
    const auto number = value.template get<std::int64_t>();
    if (number >= least && number <= most) return number;
  }
  throw std::runtime_error(fmt::format(
      "got {}, expected a whole number from {} to {}",
      value.is_number() ? value.dump() : std::string("a value of type ") + value.type_name(), least, most));
}

// The same for a member of an object, which the message names. Throws Json::exception if there is none.
template <typename Json>
std::int64_t whole_number_at(const Json& object, const char* key, std::int64_t least = 0,
                             std::int64_t most = std::numeric_limits<std::int64_t>::max()) {
  const Json& value = object.at(key);
  try {
    return whole_number(value, least, most);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", key, error.what()));
  }
}

}  // namespace q3d::manifests
