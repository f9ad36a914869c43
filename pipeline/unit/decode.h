// The step that decodes the pictures of a unit.
#pragma once

#include <string>

#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/picture_needs.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Decodes, checks and crops one candidate's picture. A bad picture is a failure in the result. If the
// candidate has digests, the bytes that are decoded must have them, so that provenance names what was used.
// Throws manifests::IoError if a picture or mask is there and cannot be read, and std::runtime_error if one
// is gone, or has other bytes, since it was digested.
DecodedSample decode_sample(const candidates::Candidate& candidate, Wanted want,
                            const config::ShardConfig& shards);

// Returns the area of a mask in the network's crop, in px of the crop, soft edges included. It is 0 if the
// mask is absent, unreadable, no silhouette, or not of the picture's size. Needs no picture.
double mask_area_px(const std::string& mask_path, const manifests::Box& box, int image_width_px,
                    int image_height_px);

// Fills work.decoded, in parallel, with the parts of each picture that later steps need (picture_needs.h).
// `rules` may be null when only predictions are wanted; then no stored crops are made. Throws as
// decode_sample does.
void decode_unit(UnitWork& work, const config::ShardConfig& shards, const config::JudgingRules* rules);

// Frees the pixels of stored crops that will not be encoded, because a verdict has dropped their candidates.
void free_unneeded_crops(UnitWork& work, const config::JudgingRules& rules);

}  // namespace q3d::pipeline::unit
