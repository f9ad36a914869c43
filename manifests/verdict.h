// The verdict on one candidate: how it ended, why, and the numbers that decided.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "manifests/sample.h"
#include "manifests/trust.h"

namespace q3d::manifests {

enum class Verdict : std::uint8_t { retained, refined, discarded, failed };
std::string_view to_string(Verdict verdict);
Verdict verdict_from_string(std::string_view name);  // throws std::invalid_argument on an unknown name

// Where the label of a sample in a shard comes from. `truth` comes from the annotation file, `retained`
// directly from the network, and `refined` from test-time adaptation. `two_d_only` has keypoints and no body.
enum class LabelKind : std::uint8_t { truth, retained, refined, two_d_only };
std::string_view to_string(LabelKind kind);
LabelKind label_kind_from_string(std::string_view name);  // throws std::invalid_argument on an unknown name

struct Judgement {
  Verdict verdict = Verdict::failed;
  Reason reason = Reason::none;
  std::string detail;  // a sentence for people; for a kept sample a remark or empty
  // L_proj in crop units (crop side = 1); NaN if it was never computed.
  double initial_error = std::numeric_limits<double>::quiet_NaN();
  double final_error = std::numeric_limits<double>::quiet_NaN();
  double gain = std::numeric_limits<double>::quiet_NaN();  // relative gain within the first ten iterations
  int iterations = 0;                                      // adaptation steps taken
  int best_iteration = 0;  // number of the kept iterate; 0 is the prediction itself
  TrustScores trust;       // of the label
};

}  // namespace q3d::manifests
