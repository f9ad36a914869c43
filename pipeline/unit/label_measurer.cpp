#include "pipeline/unit/label_measurer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <stdexcept>

#include "filters/metrics.h"
#include "loaders/keypoints/topology.h"
#include "loaders/pictures/crop.h"
#include "pipeline/render/silhouette.h"
#include "pipeline/unit/crop_keypoints.h"
#include "smal/axis_angle.h"
#include "smal/numbers.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Verdict;

// Returns the range of limb lengths of the families' mean bodies, in the pose of the template. Bones keep
// their lengths in every other pose.
filters::LimbRange family_limbs(const device::PriorNumbers& priors, const device::BodyMeshes& meshes) {
  std::vector<smal::Body> bodies;
  for (const auto& betas : priors.family_betas) {
    bodies.push_back({.pose = smal::rotation_matrices({}), .betas = betas});
  }
  std::vector<std::array<double, 12>> limbs;
  for (const device::BodyMesh& mesh : meshes.pose(bodies)) {
    limbs.push_back(filters::relative_limb_lengths(mesh.joints));
  }
  return filters::limb_range(limbs);
}

}  // namespace

struct LabelMeasurer::Label {
  std::size_t sample;  // position within the unit
  const device::BodyPrediction* body;
};

std::vector<LabelMeasurer::Label> LabelMeasurer::kept_labels(const UnitWork& work) {
  std::vector<Label> labels;
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    if (work.candidates[i].role == config::Role::pseudo && work.judgements[i].verdict == Verdict::retained) {
      labels.push_back({i, &(*work.predicted)[i].body});
    }
  }
  for (const RefinedSample& refined : *work.refined) {
    if (work.judgements[refined.sample].verdict == Verdict::refined) {
      labels.push_back({refined.sample, &refined.body});
    }
  }
  std::sort(labels.begin(), labels.end(), [](const Label& a, const Label& b) { return a.sample < b.sample; });
  return labels;
}

LabelMeasurer::LabelMeasurer(MeasuringModels models)
    : mirror_(loaders::keypoints::topology("animal3d26").flip),
      priors_(std::move(models.priors)),
      meshes_(std::move(models.meshes)) {
  if (!meshes_) throw std::invalid_argument("labels are measured with a body model, and there is none");
  faces_ = meshes_->faces();
  if (priors_) limb_range_ = family_limbs(*priors_, *meshes_);
}

manifests::TrustScores LabelMeasurer::measure_one(const UnitWork& work, const Label& label,
                                                  const device::BodyMesh& mesh) const {
  const device::CropKeypoints& keypoints = work.keypoints[label.sample];
  const device::BodyPrediction& body = *label.body;
  manifests::TrustScores scores;
  scores.visible = visible_keypoints(keypoints);
  scores.aux_2d = filters::mean_absolute_difference(smal::numbers_of(body.aux_keypoints_2d),
                                                    smal::numbers_of(body.keypoints_2d));
  scores.aux_3d = filters::procrustes_error_mm(body.aux_keypoints_3d, body.keypoints_3d);
  scores.sides = filters::left_right_ratio(body.keypoints_2d, keypoints, mirror_);
  if (priors_) {
    const auto family = static_cast<int>(work.candidates[label.sample].record.family);
    scores.pose_prior = filters::pose_deviation(body.pose, priors_->pose);
    scores.shape_prior = filters::shape_deviation(body.betas, family, priors_->shape);
    scores.limbs = filters::limb_factor(filters::relative_limb_lengths(mesh.joints), *limb_range_);
  }
  const std::vector<std::uint8_t>& mask = work.decoded[label.sample].patch_mask;
  if (!mask.empty()) {
    scores.mask = filters::mask_iou(render::crop_silhouette(mesh.vertices, body.translation, faces_), mask);
  }
  return scores;
}

std::vector<MeasuredLabel> LabelMeasurer::measure(const UnitWork& work, const NetworkSource& network,
                                                  const Watch& watch) const {
  const std::vector<Label> labels = kept_labels(work);
  std::vector<MeasuredLabel> measured(labels.size());
  if (labels.empty()) return measured;
  std::vector<smal::Body> bodies;
  std::vector<std::vector<std::uint8_t>> patches;
  for (const Label& label : labels) {
    bodies.push_back(*label.body);
    patches.push_back(mirrored_patch(work.decoded[label.sample].patch));
  }
  const std::vector<device::BodyMesh> meshes = meshes_->pose(bodies);
  const std::vector<device::PatchView> views(patches.begin(), patches.end());
  std::vector<device::BodyPrediction> mirrored;
  watch.for_each_batch(views.size(), [&](std::size_t first, std::size_t count) {
    const auto some = network().predict(std::span(views).subspan(first, count));
    mirrored.insert(mirrored.end(), some.begin(), some.end());
    if (watch.observer != nullptr) watch.observer->batch_done(work, "measure", first + count, views.size());
  });
  tbb::parallel_for(std::size_t{0}, labels.size(), [&](std::size_t i) {
    measured[i].sample = labels[i].sample;
    measured[i].scores = measure_one(work, labels[i], meshes[i]);
    // The score is NaN if the mirrored picture's body is not finite.
    measured[i].scores.mirror = filters::procrustes_error_mm(
        filters::mirrored_keypoints(mirrored[i].keypoints_3d, mirror_), labels[i].body->keypoints_3d);
  });
  return measured;
}

std::vector<std::uint8_t> mirrored_patch(device::PatchView patch) {
  constexpr auto kSide = static_cast<std::size_t>(loaders::pictures::kPatchSidePx);
  if (patch.size() != kSide * kSide * 3) {
    throw std::invalid_argument("mirrored_patch: got " + std::to_string(patch.size()) + " bytes, expected " +
                                std::to_string(kSide * kSide * 3));
  }
  std::vector<std::uint8_t> mirrored(patch.size());
  for (std::size_t y = 0; y < kSide; ++y) {
    for (std::size_t x = 0; x < kSide; ++x) {
      const auto from = patch.begin() + static_cast<std::ptrdiff_t>(3 * (y * kSide + kSide - 1 - x));
      std::copy_n(from, 3, mirrored.begin() + static_cast<std::ptrdiff_t>(3 * (y * kSide + x)));
    }
  }
  return mirrored;
}

}  // namespace q3d::pipeline::unit
