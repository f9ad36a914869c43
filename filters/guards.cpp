#include "filters/guards.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "manifests/sample.h"

namespace q3d::filters {
namespace {

using manifests::Judgement;
using manifests::Reason;
using manifests::Verdict;

void require(bool holds, std::string_view rule, double got) {
  if (!holds) throw std::invalid_argument(fmt::format("guards: {} must hold, got {}", rule, got));
}

void require_not_negative(double value, std::string_view name) {
  require(std::isfinite(value) && value >= 0.0, fmt::format("0 <= {}", name), value);
}

void discard(Judgement& judgement, Reason reason, const std::string& detail) {
  if (judgement.verdict != Verdict::discarded) {
    judgement.verdict = Verdict::discarded;
    judgement.reason = reason;
    judgement.detail = detail;
  } else {
    judgement.detail += "; " + detail;
  }
}

}  // namespace

void check(const GuardBounds& bounds) {
  require(bounds.visible_min >= 0 && bounds.visible_min <= manifests::kNumKeypoints, "0 <= visible_min <= 26",
          bounds.visible_min);
  require_not_negative(bounds.pose_deviation_max, "pose_deviation_max");
  require_not_negative(bounds.limb_factor_max, "limb_factor_max");
  require_not_negative(bounds.left_right_max, "left_right_max");
  require(bounds.mask_iou_min >= 0.0 && bounds.mask_iou_min <= 1.0, "0 <= mask_iou_min <= 1",
          bounds.mask_iou_min);
}

bool is_any_on(const GuardBounds& bounds) {
  return bounds.visible_min > 0 || bounds.pose_deviation_max > 0.0 || bounds.limb_factor_max > 0.0 ||
         bounds.left_right_max > 0.0 || bounds.mask_iou_min > 0.0;
}

Judgement apply_bounds(Judgement judgement, const manifests::TrustScores& scores, const GuardBounds& bounds) {
  if (judgement.verdict != Verdict::retained && judgement.verdict != Verdict::refined) return judgement;
  if (scores.visible < bounds.visible_min) {
    discard(judgement, Reason::too_few_keypoints,
            fmt::format("{} visible keypoints, visible_min {}", scores.visible, bounds.visible_min));
  }
  // A comparison with NaN is false, so NaN breaks no bound.
  const auto at_most = [&](double value, double bound, Reason reason, const char* name) {
    if (bound > 0.0 && value > bound) {
      discard(judgement, reason, fmt::format("{0} {1:.4g}, {0}_max {2:.4g}", name, value, bound));
    }
  };
  at_most(scores.pose_prior, bounds.pose_deviation_max, Reason::pose_implausible, "pose_deviation");
  at_most(scores.limbs, bounds.limb_factor_max, Reason::limbs_implausible, "limb_factor");
  at_most(scores.sides, bounds.left_right_max, Reason::left_right_swapped, "left_right");
  if (scores.mask < bounds.mask_iou_min) {
    discard(judgement, Reason::mask_mismatch,
            fmt::format("mask_iou {:.4g}, mask_iou_min {:.4g}", scores.mask, bounds.mask_iou_min));
  }
  return judgement;
}

int scaled_iterations(int iterations, int visible, int full_at) {
  if (iterations < 0 || visible < 0 || full_at < 0) {
    throw std::invalid_argument(
        fmt::format("scaled_iterations: got {} iterations, {} visible keypoints and full_at {}, expected "
                    "numbers of 0 or more",
                    iterations, visible, full_at));
  }
  if (visible >= full_at) return iterations;
  const long scaled = std::lround(static_cast<double>(iterations) * visible / full_at);
  return std::max(1, static_cast<int>(scaled));
}

}  // namespace q3d::filters
