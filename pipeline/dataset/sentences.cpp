#include "pipeline/dataset/sentences.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "manifests/enumerators.h"
#include "pipeline/dataset/dataset_manifest.h"

namespace q3d::pipeline::dataset {
namespace {

using filters::Thresholds;
using manifests::Judgement;
using manifests::LabelKind;
using manifests::Reason;
using manifests::Verdict;

// Reports a value that is no enumerator at all.
[[noreturn]] void no_enumerator(const char* type, int value) {
  throw std::logic_error(fmt::format("{}: got {}, which is no enumerator", type, value));
}

bool is_below_tau_low(const Judgement& judgement, const Thresholds& thresholds) {
  return judgement.initial_error < thresholds.tau_low;
}

// Describes the adaptation of a candidate that was adapted, whether it was kept or not.
std::string adaptation(const Judgement& judgement, const Thresholds& thresholds) {
  const std::string why_adapted =
      is_below_tau_low(judgement, thresholds)
          ? fmt::format(
                "lies below tau_low = {:.4f}, and it was adapted all the same, as tta.refine_retained "
                "asks for",
                thresholds.tau_low)
          : fmt::format("lies between tau_low = {:.4f} and tau_high = {:.4f}, so it was adapted",
                        thresholds.tau_low, thresholds.tau_high);
  return fmt::format(
      "L_proj of the prediction, {:.4f}, {}. In {} iterations L_proj fell to {:.4f}, which it reached at "
      "iteration {}.",
      judgement.initial_error, why_adapted, judgement.iterations, judgement.final_error,
      judgement.best_iteration);
}

std::string gain(const Judgement& judgement, const Thresholds& thresholds, const char* relation) {
  return fmt::format("Its gain within the first iterations, {:.2f} %, {} delta = {:.2f} %",
                     100 * judgement.gain, relation, 100 * thresholds.delta);
}

// Returns the numbers behind a reason of the fidelity rule itself; empty for every other reason.
std::string numbers(const Judgement& judgement, const std::optional<Thresholds>& thresholds) {
  if (!thresholds) return {};
  if (judgement.reason == Reason::error_too_large) {
    return fmt::format("L_proj of the prediction, {:.4f}, reaches tau_high = {:.4f}.",
                       judgement.initial_error, thresholds->tau_high);
  }
  if (judgement.reason == Reason::gain_too_small) {
    return adaptation(judgement, *thresholds) + " " + gain(judgement, *thresholds, "is less than") + ".";
  }
  return {};
}

// "It was vetoed." and the detail "the tail is bent" become "It was vetoed: the tail is bent."
std::string with_detail(std::string_view told, const std::string& detail) {
  if (detail.empty()) return std::string(told);
  const bool has_colon = told.find(':') != std::string_view::npos;
  told.remove_suffix(1);
  return fmt::format(fmt::runtime(has_colon ? "{} ({})." : "{}: {}."), told, detail);
}

std::string why_kept(const Judgement& judgement, config::Role role,
                     const std::optional<Thresholds>& thresholds) {
  switch (role) {
    case config::Role::truth:
      return "Its label is the body of the annotation file; the fidelity rule judges predictions only.";
    case config::Role::two_d_only:
      return "Its label is the annotated keypoints without a body; the fidelity rule judges predictions "
             "only.";
    case config::Role::pseudo:
      break;
  }
  if (!thresholds) {
    throw std::runtime_error("dataset.json has no thresholds for the dataset of a candidate that was kept");
  }
  if (judgement.verdict == Verdict::retained) {
    return fmt::format("L_proj of the prediction, {:.4f}, lies below tau_low = {:.4f}, so it was kept{}.",
                       judgement.initial_error, thresholds->tau_low,
                       judgement.iterations > 0 ? ", and adaptation found nothing better" : "");
  }
  const std::string course = adaptation(judgement, *thresholds) + " ";
  if (is_below_tau_low(judgement, *thresholds)) return course + "It is kept with this better body.";
  if (judgement.gain >= thresholds->delta) {
    return course + gain(judgement, *thresholds, "reaches") + ", so it was kept.";
  }
  // This happens with tta.stop_below, and in version 0.1, which ended adaptation early.
  return course + "Adaptation was told to end there before its gain was asked for, so it was kept.";
}

// Describes a mean L_proj in words. On the rendered world, whose truth is known, labels at these bounds have
// an AUC of about 93 and 87 (docs/results.md).
std::string_view in_words(double mean_error) {
  if (mean_error < 0.02) return "close to";
  if (mean_error < 0.04) return "near";
  if (mean_error < 0.08) return "only roughly at";
  return "far from";
}

}  // namespace

std::string quality_sentence(const DatasetManifest& manifest) {
  if (!manifest.all.mean_final_error) return "no label has a projection to compare with the keypoints.";
  const double mean = *manifest.all.mean_final_error;
  std::string told =
      fmt::format("the labels lie {} the annotated keypoints: {:.1f} % of the crop's side off on average",
                  in_words(mean), 100 * mean);
  if (manifest.all.mean_initial_error && *manifest.all.mean_initial_error > mean) {
    told += fmt::format(", {:.1f} % as predicted", 100 * *manifest.all.mean_initial_error);
  }
  told += ". This says nothing of the third dimension; look at some of them (`inspect --sheet`).";
  if (!manifest.warnings.empty()) {
    told += fmt::format(" There {} {} warning{}.", manifest.warnings.size() == 1 ? "is" : "are",
                        manifest.warnings.size(), manifest.warnings.size() == 1 ? "" : "s");
  }
  return told;
}

std::string_view sentence(Verdict verdict) {
  switch (verdict) {
    case Verdict::retained:
      return "Its label was taken as it came, from the network or from the annotation file.";
    case Verdict::refined:
      return "Its label is the network's prediction after test-time adaptation.";
    case Verdict::discarded:
      return "It has no label, because the fidelity rule, a guard or the user left it out.";
    case Verdict::failed:
      return "It has no label, because its annotation, its picture or its prediction could not be used.";
  }
  no_enumerator("Verdict", static_cast<int>(verdict));
}

std::string_view sentence(LabelKind kind) {
  switch (kind) {
    case LabelKind::truth:
      return "The body comes from the annotation file.";
    case LabelKind::retained:
      return "The body is the network's prediction as it came.";
    case LabelKind::refined:
      return "The body is the network's prediction after test-time adaptation.";
    case LabelKind::two_d_only:
      return "The sample has annotated keypoints and no body.";
  }
  no_enumerator("LabelKind", static_cast<int>(kind));
}

std::string_view sentence(Reason reason) {
  switch (reason) {
    case Reason::none:
      return "Nothing speaks against this candidate.";
    case Reason::box_missing:
      return "The annotation has no box around the animal.";
    case Reason::box_not_finite:
      return "A number of the annotation's box is not finite.";
    case Reason::box_zero_size:
      return "The annotation's box has no width or no height.";
    case Reason::box_outside_image:
      return "The annotation's box does not touch the picture.";
    case Reason::box_too_small:
      return "The annotation's box is only a few pixels wide and high.";
    case Reason::keypoints_missing:
      return "The annotation has no keypoints.";
    case Reason::keypoints_wrong_length:
      return "The annotation does not have as many keypoints as its format asks for.";
    case Reason::keypoints_not_finite:
      return "A coordinate of the annotated keypoints is not finite.";
    case Reason::no_visible_keypoints:
      return "No annotated keypoint is visible, so there is nothing to compare a label with.";
    case Reason::keypoints_outside:
      return "Most annotated keypoints lie outside the picture or outside their box, or all lie in one "
             "place.";
    case Reason::not_in_pixels:
      return "The annotation gives fractions of the picture's size where pixels are expected.";
    case Reason::record_malformed:
      return "A field of the annotation has the wrong form.";
    case Reason::image_not_listed:
      return "The annotation refers to a picture that its file does not list.";
    case Reason::pose_missing:
      return "The label should come from the annotation file, but the annotation has no pose.";
    case Reason::not_a_quadruped:
      return "The body model cannot show an animal of this species.";
    case Reason::duplicate:
      return "An earlier candidate has the same picture and the same keypoints.";
    case Reason::image_missing:
      return "The picture was not found.";
    case Reason::image_empty:
      return "The picture's file is empty.";
    case Reason::image_is_lfs_pointer:
      return "The picture's file is a Git-LFS pointer, which `git lfs pull` replaces by the picture.";
    case Reason::image_not_an_image:
      return "The picture's file is neither a JPEG nor a PNG.";
    case Reason::image_truncated:
      return "The picture's file ends before the picture does.";
    case Reason::image_too_large:
      return "The picture is larger than this program accepts.";
    case Reason::path_escapes_root:
      return "The picture's path leads out of the dataset's folder.";
    case Reason::size_mismatch:
      return "The picture does not have the size that the annotation file states, so the labels do not fit "
             "it.";
    case Reason::prediction_not_finite:
      return "The network gave a number that is not finite.";
    case Reason::error_too_large:
      return "The prediction lies too far from the annotated keypoints to be refined.";
    case Reason::gain_too_small:
      return "Adaptation brought the prediction too little closer to the annotated keypoints.";
    case Reason::too_few_keypoints:
      return "A guard left it out: it has too few visible keypoints.";
    case Reason::scaled_gain_too_small:
      return "A guard left it out: adaptation gained too little within the fewer iterations that its few "
             "visible keypoints allow.";
    case Reason::held_out_not_better:
      return "A guard left it out: adaptation brought the held-out keypoints no closer.";
    case Reason::pose_implausible:
      return "A guard left it out: its pose is too far from the pose prior.";
    case Reason::limbs_implausible:
      return "A guard left it out: the length of a limb is too far from those of the five families.";
    case Reason::left_right_swapped:
      return "A guard left it out: the label fits the annotation better with left and right exchanged.";
    case Reason::mask_mismatch:
      return "A guard left it out: the body's silhouette and the mask overlap too little.";
    case Reason::vetoed:
      return "It was left out by the veto list.";
    case Reason::in_test_split:
      return "It was left out because its picture, or a copy of it, is in a test set.";
    case Reason::trust_too_low:
      return "It was left out because its label is trusted too little.";
  }
  no_enumerator("Reason", static_cast<int>(reason));
}

std::string why(const Judgement& judgement, config::Role role, const std::optional<Thresholds>& thresholds) {
  if (judgement.reason == Reason::none) {
    if (manifests::is_kept(judgement.verdict)) return why_kept(judgement, role, thresholds);
    return with_detail(sentence(judgement.verdict), judgement.detail);
  }
  const std::string decided = numbers(judgement, thresholds);
  if (decided.empty()) return with_detail(sentence(judgement.reason), judgement.detail);
  return std::string(sentence(judgement.reason)) + " " + decided;
}

}  // namespace q3d::pipeline::dataset
