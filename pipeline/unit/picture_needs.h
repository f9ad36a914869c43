// A decision table says what the steps to come need of a candidate's picture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Says how far a candidate has come when its unit is decoded.
enum class Standing : std::uint8_t {
  unpredicted,  // its picture must be decoded, if only to learn whether it can be
  to_adapt,     // the rule adapts its prediction, which has not been done
  may_be_kept,  // no verdict so far drops it
  finished,     // it failed, it was dropped, or the run makes predictions only
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
  bool mask_area = false;    // of the patch; comes with it
  bool patch_mask = false;   // likewise
};

// Returns the parts that the steps to come need. It is empty if the picture need not be decoded.
std::optional<Wanted> wanted(const PictureFacts& facts);

// Returns the facts of candidate `i` of the unit. `rules` is null in a run that makes predictions only. Needs
// work.judgements where work.refined is there.
PictureFacts picture_facts(const UnitWork& work, std::size_t i, const config::JudgingRules* rules);

}  // namespace q3d::pipeline::unit
