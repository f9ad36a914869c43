#include "pipeline/unit/shard_assembly.h"

#include <map>
#include <stdexcept>

#include "pipeline/unit/judge.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::ShardSample;
using manifests::Verdict;

// A predicted body is a label in full; an annotated one only where the file gives values.
void set_label(ShardSample& sample, const device::BodyPrediction& body) {
  const bool is_truth = sample.label_kind == manifests::LabelKind::truth;
  const bool has_body = sample.label_kind != manifests::LabelKind::two_d_only;
  sample.has_pose = has_body && (!is_truth || sample.record.truth->has_pose);
  sample.has_betas = has_body && (!is_truth || sample.record.truth->has_betas);
  sample.has_keypoints_3d = has_body && (!is_truth || sample.record.truth->has_keypoints_3d);
  sample.body = static_cast<const smal::Body&>(body);
  sample.keypoints_3d = body.keypoints_3d;
  sample.projected_2d = body.keypoints_2d;
}

void set_picture(ShardSample& sample, const PredictedSample& predicted) {
  sample.image_width_px = predicted.image_width_px;
  sample.image_height_px = predicted.image_height_px;
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(sample.record.box);
  sample.patch_box = {box.center_x_px, box.center_y_px, box.side_px};
}

// Moves the bytes instead of copying them.
void take_crop(ShardSample& sample, EncodedCrop& crop) {
  sample.crop = std::move(crop.picture);
  sample.crop_mask = std::move(crop.mask);
  sample.crop_side_px = crop.side_px;
  sample.crop_from_image = crop.from_image;
}

// Returns the crop of each position in the unit, or null where there is none.
std::vector<EncodedCrop*> crops_by_position(UnitWork& work) {
  std::vector<EncodedCrop*> crops(work.candidates.size(), nullptr);
  for (EncodedCrop& crop : work.crops) crops.at(crop.sample) = &crop;
  return crops;
}

}  // namespace

std::vector<ShardSample> shard_samples(UnitWork& work) {
  std::map<std::size_t, const device::BodyPrediction*> refined_bodies;
  for (const RefinedSample& refined : *work.refined) refined_bodies[refined.sample] = &refined.body;
  const std::vector<EncodedCrop*> crops = crops_by_position(work);
  std::vector<ShardSample> samples;
  samples.reserve(work.candidates.size());  // samples are large, so avoid moving them
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    const manifests::Judgement& judgement = work.judgements[i];
    if (!is_kept(judgement)) continue;
    if (crops[i] == nullptr) throw std::logic_error(work.candidates[i].record.id + " is kept without a crop");
    ShardSample& sample = samples.emplace_back();
    sample.record = work.candidates[i].record;
    sample.image_sha256 = work.candidates[i].image_sha256;
    sample.judgement = judgement;
    sample.label_kind = config::label_kind(work.candidates[i].role, judgement.verdict);
    const bool refined = judgement.verdict == Verdict::refined;
    set_label(sample, refined ? *refined_bodies.at(i) : (*work.predicted)[i].body);
    set_picture(sample, (*work.predicted)[i]);
    take_crop(sample, *crops[i]);
  }
  return samples;
}

}  // namespace q3d::pipeline::unit
