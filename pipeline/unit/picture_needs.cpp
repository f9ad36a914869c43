#include "pipeline/unit/picture_needs.h"

#include <array>
#include <cmath>

#include "filters/fidelity.h"
#include "pipeline/unit/judge.h"

namespace q3d::pipeline::unit {
namespace {

using filters::Band;
using manifests::Reason;

// The table says which parts a candidate may need in each standing. PictureFacts decides whether it really
// needs them. Pseudo labels need patches, samples of a shard need stored crops, and candidates that are
// measured against a mask need the mask. A patch is needed once more when a label is measured, because its
// mirror image is predicted.
struct Needs {
  Standing standing;
  bool decoding;  // even if no part is needed
  bool patch;
  bool stored_crop;
  bool patch_mask;
};
// The rows are in the order of Standing.
constexpr std::array<Needs, 4> kNeeds{{
    // standing             decoding  patch  stored_crop  patch_mask
    {Standing::unpredicted, true, true, true, true},
    {Standing::to_adapt, false, true, true, true},
    {Standing::may_be_kept, false, false, true, true},
    {Standing::finished, false, false, false, false},
}};

Standing standing_of(const UnitWork& work, std::size_t i, const config::JudgingRules* rules) {
  const candidates::Candidate& candidate = work.candidates[i];
  if (candidate.record.failure != Reason::none) return Standing::finished;
  if (!work.predicted) return Standing::unpredicted;
  const PredictedSample& predicted = (*work.predicted)[i];
  if (rules == nullptr || predicted.failure != Reason::none) return Standing::finished;
  if (candidate.role != config::Role::pseudo) return Standing::may_be_kept;
  if (std::isnan(work.errors[i])) return Standing::finished;
  if (work.refined) return is_kept(work.judgements[i]) ? Standing::may_be_kept : Standing::finished;
  const filters::Thresholds& thresholds = rules->of(candidate.record.dataset);
  if (filters::is_adapted(work.errors[i], thresholds)) return Standing::to_adapt;
  return filters::band(work.errors[i], thresholds) == Band::retain ? Standing::may_be_kept
                                                                   : Standing::finished;
}

}  // namespace

std::optional<Wanted> wanted(const PictureFacts& facts) {
  const Needs& needs = kNeeds.at(static_cast<std::size_t>(facts.standing));
  const bool measures = facts.standing == Standing::may_be_kept && facts.measures_label;
  const Wanted want{.patch = (needs.patch || measures) && facts.is_pseudo,
                    .stored_crop = needs.stored_crop && facts.lacks_crop,
                    .patch_mask = needs.patch_mask && facts.measures_label && facts.has_mask};
  const bool needs_part = want.patch || want.stored_crop || want.patch_mask;
  return needs.decoding || needs_part ? std::optional(want) : std::nullopt;
}

PictureFacts picture_facts(const UnitWork& work, std::size_t i, const config::JudgingRules* rules) {
  const candidates::Candidate& candidate = work.candidates[i];
  PictureFacts facts;
  facts.standing = standing_of(work, i, rules);
  facts.is_pseudo = candidate.role == config::Role::pseudo;
  if (rules == nullptr) return facts;
  facts.lacks_crop =
      !work.shard_before && candidate.exclusion.reason == Reason::none && find_crop(work, i) == nullptr;
  facts.measures_label = facts.is_pseudo && !work.measured;
  facts.has_mask = !candidate.record.mask_path.empty();
  return facts;
}

}  // namespace q3d::pipeline::unit
