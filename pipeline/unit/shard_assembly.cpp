#include "pipeline/unit/shard_assembly.h"

#include <fmt/format.h>

#include <map>
#include <stdexcept>

namespace q3d::pipeline::unit {
namespace {

using manifests::ShardSample;
using manifests::Verdict;

// What of a kept candidate's body is a label: all that a network gives, of a truth what the file gives.
void set_label(ShardSample& sample, const device::BodyPrediction& body) {
  const bool is_truth = sample.label_kind == manifests::LabelKind::truth;
  const bool has_body = sample.label_kind != manifests::LabelKind::two_d_only;
  sample.has_pose = has_body && (!is_truth || sample.record.truth->has_pose);
  sample.has_betas = has_body && (!is_truth || sample.record.truth->has_betas);
  sample.has_keypoints_3d = has_body && (!is_truth || sample.record.truth->has_keypoints_3d);
  sample.pose = body.rotations;
  sample.betas = body.betas;
  sample.camera = body.camera;
  sample.trans = body.translation;
  sample.keypoints_3d = body.keypoints_3d;
  sample.projected_2d = body.keypoints_2d;
}

void set_picture(ShardSample& sample, const DecodedSample& decoded) {
  sample.image_width_px = decoded.image_width_px;
  sample.image_height_px = decoded.image_height_px;
  sample.crop = decoded.stored_crop;
  sample.crop_mask = decoded.stored_mask;
  sample.crop_side_px = decoded.stored_side_px;
  sample.crop_from_image = decoded.stored_from_image;
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(sample.record.box);
  sample.patch_box = {box.center_x_px, box.center_y_px, box.side_px};
}

}  // namespace

std::vector<ShardSample> shard_samples(const UnitWork& work) {
  std::map<std::size_t, const device::BodyPrediction*> refined_bodies;
  for (const RefinedSample& refined : *work.refined) refined_bodies[refined.sample] = &refined.body;
  std::vector<ShardSample> samples;
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    const manifests::Judgement& judgement = work.judgements[i];
    if (judgement.verdict != Verdict::retained && judgement.verdict != Verdict::refined) continue;
    if (!work.decoded[i].decoded) {
      // The picture was readable when it was predicted; a label without its picture must not be written.
      throw std::runtime_error(fmt::format(
          "{}: the picture {} could be read before and cannot now ({}); put it back "
          "and build again",
          work.candidates[i].record.id, work.candidates[i].record.image_path, work.decoded[i].detail));
    }
    ShardSample& sample = samples.emplace_back();
    sample.record = work.candidates[i].record;
    sample.image_sha256 = work.candidates[i].image_sha256;
    sample.judgement = judgement;
    sample.label_kind = config::label_kind(work.candidates[i].role, judgement.verdict);
    const bool refined = judgement.verdict == Verdict::refined;
    set_label(sample, refined ? *refined_bodies.at(i) : (*work.predicted)[i].body);
    set_picture(sample, work.decoded[i]);
  }
  return samples;
}

}  // namespace q3d::pipeline::unit
