// This header is for code that goes through the enumerators of verdicts. It has all their names in order, and
// says which verdicts are kept.
#pragma once

#include <span>
#include <string_view>

#include "manifests/sample.h"
#include "manifests/verdict.h"

namespace q3d::manifests {

// The names are in the order of the enumerators, whose values count up from 0.
std::span<const std::string_view> reason_names();
std::span<const std::string_view> verdict_names();
std::span<const std::string_view> label_kind_names();

// Returns whether a candidate with this verdict has a row in a shard.
constexpr bool is_kept(Verdict verdict) {
  return verdict == Verdict::retained || verdict == Verdict::refined;
}

}  // namespace q3d::manifests
