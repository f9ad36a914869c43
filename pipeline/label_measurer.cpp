#include "pipeline/label_measurer.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <stdexcept>
#include <thread>

#include "loaders/topology.h"
#include "pipeline/silhouette.h"
#include "pipeline/unit_steps.h"

namespace q3d::pipeline {
namespace {

using manifests::Verdict;

PriorNumbers load_priors(const std::filesystem::path& file) {
  try {
    return read_priors(file);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("{}\nThe guards pose_deviation_max and limb_factor_max need the pose and shape priors: "
                    "give their file as guards.priors",
                    error.what()));
  }
}

// Of the families' mean bodies, in the pose of the template: bones keep their lengths in any other.
filters::LimbRange family_limbs(const PriorNumbers& priors, const BodyMeshes& meshes) {
  std::vector<BodyShape> shapes;
  for (const auto& betas : priors.family_betas) {
    shapes.push_back({rotation_matrices({}), betas});
  }
  std::vector<std::array<double, 12>> limbs;
  for (const BodyMesh& mesh : meshes.pose(shapes)) {
    limbs.push_back(filters::relative_limb_lengths(mesh.joints));
  }
  return filters::limb_range(limbs);
}

int operator_threads(const NetworkConfig& network) {
  if (network.compute_threads > 0) return network.compute_threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

// A label to measure.
struct Label {
  std::size_t sample;
  const BodyPrediction* body;
};

std::vector<Label> kept_labels(const UnitWork& work) {
  std::vector<Label> labels;
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    if (work.candidates[i].role == Role::pseudo && work.judgements[i].verdict == Verdict::retained) {
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

std::filesystem::path priors_file(const BuildConfig& config) {
  return config.guards.priors.empty() ? config.network.checkpoint : config.guards.priors;
}

bool uses_priors(const GuardConfig& guards) {
  return guards.pose_deviation_max > 0.0 || guards.limb_factor_max > 0.0;
}

LabelMeasurer::LabelMeasurer(const BuildConfig& config) : guards_(config.guards) {
  if (guards_.limb_factor_max > 0.0 || guards_.mask_iou_min > 0.0) {
    meshes_ = std::make_unique<BodyMeshes>(config.network.smal_asset, operator_threads(config.network));
    faces_ = meshes_->faces();
  }
  if (!uses_priors(guards_)) return;
  PriorNumbers priors = load_priors(priors_file(config));
  if (guards_.limb_factor_max > 0.0) limb_range_ = family_limbs(priors, *meshes_);
  if (guards_.pose_deviation_max > 0.0) pose_prior_ = std::move(priors.pose);
}

filters::LabelMeasures LabelMeasurer::measure_one(const CropKeypoints& keypoints, const BodyPrediction& body,
                                                  const BodyMesh* mesh, const DecodedSample* decoded) const {
  static const std::vector<int> kMirror = loaders::topology("animal3d26").flip;
  filters::LabelMeasures measures;
  measures.visible = visible_keypoints(keypoints);
  if (guards_.left_right_max > 0.0) {
    measures.left_right = filters::left_right_ratio(body.keypoints_2d, keypoints, kMirror);
  }
  if (pose_prior_) measures.pose_deviation = filters::pose_deviation(body.rotations, *pose_prior_);
  if (limb_range_) {
    measures.limb_factor = filters::limb_factor(filters::relative_limb_lengths(mesh->joints), *limb_range_);
  }
  if (guards_.mask_iou_min > 0.0 && decoded != nullptr && !decoded->patch_mask.empty()) {
    measures.mask_iou =
        filters::mask_iou(crop_silhouette(mesh->vertices, body.translation, faces_), decoded->patch_mask);
  }
  return measures;
}

std::vector<MeasuredLabel> LabelMeasurer::measure(const UnitWork& work) const {
  const std::vector<Label> labels = kept_labels(work);
  std::vector<BodyMesh> meshes;
  if (meshes_) {
    std::vector<BodyShape> shapes;
    for (const Label& label : labels) shapes.push_back({label.body->rotations, label.body->betas});
    meshes = meshes_->pose(shapes);
  }
  std::vector<MeasuredLabel> measured(labels.size());
  tbb::parallel_for(std::size_t{0}, labels.size(), [&](std::size_t i) {
    const std::size_t sample = labels[i].sample;
    measured[i].sample = sample;
    measured[i].measures = measure_one(crop_keypoints(work.candidates[sample].record), *labels[i].body,
                                       meshes.empty() ? nullptr : &meshes[i],
                                       work.decoded.empty() ? nullptr : &work.decoded[sample]);
  });
  return measured;
}

}  // namespace q3d::pipeline
