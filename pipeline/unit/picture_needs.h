// A decision table says which parts of a candidate's picture the later steps need.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Says how far a candidate has come when its unit is decoded.
enum class Standing : std::uint8_t {
  unpredicted,  // its picture must be decoded, at least to find out whether it can be
  to_adapt,     // the rule adapts its prediction, but this is not done yet
  may_be_kept,  // no verdict has dropped it so far
  finished,     // it failed or was dropped, or the run makes only predictions
};

// The facts that decide which parts of a picture are needed.
struct PictureFacts {
  Standing standing = Standing::finished;
  bool is_pseudo = false;       // its label comes from the network
  bool lacks_crop = false;      // the unit's shard is still to be made, the candidate may be in it, and its
                                // stored crop has not been encoded by any build
  bool measures_label = false;  // its label, if it is kept, is still to be measured
  bool has_mask = false;        // its annotation names a mask
};

// Parts of a picture.
struct Wanted {
  bool patch = false;        // the network's crop
  bool stored_crop = false;  // pixels; encode.h encodes them
  bool mask_area = false;    // area of the patch's mask; always comes with the patch
  bool patch_mask = false;   // mask of the patch; always comes with the patch
};

// Returns the parts that later steps need, or nothing if the picture need not be decoded.
std::optional<Wanted> wanted(const PictureFacts& facts);

// Returns the facts of candidate `i` of the unit. `rules` is null in a run that makes only predictions. Needs
// work.judgements if work.refined is set.
PictureFacts picture_facts(const UnitWork& work, std::size_t i, const config::JudgingRules* rules);

}  // namespace q3d::pipeline::unit
