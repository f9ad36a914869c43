// Limits how deep the objects and lists of a config may lie within each other.
#pragma once

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <string>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::config {

// Returns a callback for json::parse that throws ConfigError beyond 32 levels. Merging and printing recurse,
// so a user's file must not be able to choose the depth. `where` names the source in the message.
inline nlohmann::json::parser_callback_t refuse_depth(const std::string& where) {
  static constexpr int kMaxDepth = 32;
  return [where](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    if (depth <= kMaxDepth) return true;
    throw run::ConfigError(
        fmt::format("{}: got objects or lists within each other beyond {} levels, expected at most that",
                    where, kMaxDepth));
  };
}

}  // namespace q3d::pipeline::config
