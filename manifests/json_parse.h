// Parses JSON that may be damaged or hostile. nlohmann's parser does not recurse, but copying, comparing and
// printing a document does, so a text must not be able to choose how deep that goes.
#pragma once

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/json_keys.h"

namespace q3d::manifests {

class TooDeep : public std::runtime_error {
 public:
  explicit TooDeep(int levels)
      : std::runtime_error(fmt::format(
            "it has objects or lists within each other beyond {} levels, expected at most that", levels)) {}
};

// Far more than any file of this program or of the tools that it reads has.
inline constexpr int kMaxJsonDepth = 256;

// Returns a callback for Json::parse that throws TooDeep beyond kMaxJsonDepth levels and RepeatedKey at the
// second key of a name in one object.
template <typename Json>
typename Json::parser_callback_t refuse_hostile() {
  return refuse_repeated_keys<Json>([](int depth, typename Json::parse_event_t, Json&) {
    if (depth > kMaxJsonDepth) throw TooDeep(kMaxJsonDepth);
    return true;
  });
}

// Throws Json::exception, TooDeep and RepeatedKey.
template <typename Json>
Json parse_json(std::string_view text) {
  return Json::parse(text, refuse_hostile<Json>());
}

// The same, for files that only save work: null if the text is no such JSON.
template <typename Json>
Json parse_json_or_null(std::string_view text) {
  try {
    return parse_json<Json>(text);
  } catch (const typename Json::exception&) {
    return nullptr;
  } catch (const TooDeep&) {
    return nullptr;
  } catch (const RepeatedKey&) {
    return nullptr;
  }
}

}  // namespace q3d::manifests
