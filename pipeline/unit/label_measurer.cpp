#include "pipeline/unit/label_measurer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <stdexcept>

#include "loaders/keypoints/topology.h"
#include "pipeline/render/silhouette.h"
#include "pipeline/unit/crop_keypoints.h"
#include "smal/axis_angle.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Verdict;

// Of the families' mean bodies, in the pose of the template: bones keep their lengths in any other.
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

// A label to measure.
struct Label {
  std::size_t sample;
  const device::BodyPrediction* body;
};

std::vector<Label> kept_labels(const UnitWork& work) {
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

}  // namespace

bool needs_meshes(const config::GuardConfig& guards) {
  return guards.limb_factor_max > 0.0 || guards.mask_iou_min > 0.0;
}

LabelMeasurer::LabelMeasurer(const config::GuardConfig& guards, MeasuringModels models)
    : guards_(guards), meshes_(std::move(models.meshes)) {
  if (needs_meshes(guards_) && !meshes_) throw std::invalid_argument("the bounds need the body model");
  if (config::uses_priors(guards_) && !models.priors)
    throw std::invalid_argument("the bounds need the priors");
  if (meshes_) faces_ = meshes_->faces();
  if (guards_.limb_factor_max > 0.0) limb_range_ = family_limbs(*models.priors, *meshes_);
  if (guards_.pose_deviation_max > 0.0) pose_prior_ = std::move(models.priors->pose);
}

filters::LabelMeasures LabelMeasurer::measure_one(const device::CropKeypoints& keypoints,
                                                  const device::BodyPrediction& body,
                                                  const device::BodyMesh* mesh,
                                                  const DecodedSample* decoded) const {
  static const std::vector<int> kMirror = loaders::keypoints::topology("animal3d26").flip;
  filters::LabelMeasures measures;
  measures.visible = visible_keypoints(keypoints);
  if (guards_.left_right_max > 0.0) {
    measures.left_right = filters::left_right_ratio(body.keypoints_2d, keypoints, kMirror);
  }
  if (pose_prior_) measures.pose_deviation = filters::pose_deviation(body.pose, *pose_prior_);
  if (limb_range_) {
    measures.limb_factor = filters::limb_factor(filters::relative_limb_lengths(mesh->joints), *limb_range_);
  }
  if (guards_.mask_iou_min > 0.0 && decoded != nullptr && !decoded->patch_mask.empty()) {
    measures.mask_iou = filters::mask_iou(render::crop_silhouette(mesh->vertices, body.translation, faces_),
                                          decoded->patch_mask);
  }
  return measures;
}

std::vector<MeasuredLabel> LabelMeasurer::measure(const UnitWork& work) const {
  const std::vector<Label> labels = kept_labels(work);
  std::vector<device::BodyMesh> meshes;
  if (meshes_) {
    std::vector<smal::Body> bodies;
    for (const Label& label : labels) bodies.push_back(*label.body);
    meshes = meshes_->pose(bodies);
  }
  std::vector<MeasuredLabel> measured(labels.size());
  tbb::parallel_for(std::size_t{0}, labels.size(), [&](std::size_t i) {
    const std::size_t sample = labels[i].sample;
    measured[i].sample = sample;
    measured[i].measures =
        measure_one(work.keypoints[sample], *labels[i].body, meshes.empty() ? nullptr : &meshes[i],
                    work.decoded.empty() ? nullptr : &work.decoded[sample]);
  });
  return measured;
}

}  // namespace q3d::pipeline::unit
