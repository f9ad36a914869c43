#include "pipeline/config/build_settings.h"

#include "filters/near_duplicates.h"
#include "pipeline/config/profiles.h"
#include "smal/camera.h"
#include "smal/sizes.h"

namespace q3d::pipeline::config {
namespace {

constexpr Range kPositive{.least = 0, .is_open_below = true};
constexpr Range kAtLeastOne{.least = 1};
constexpr Range kNotNegative{.least = 0};

// Returns the word of a member that is an enum.
template <typename Struct, typename Enum>
Word<Struct> word_of(Enum Struct::*member, Enum (*from_string)(std::string_view)) {
  return {
      [member](const Struct& config) { return std::string(to_string(config.*member)); },
      [member, from_string](Struct& config, const std::string& word) { config.*member = from_string(word); }};
}

std::vector<std::string> texts(std::span<const std::string_view> names) {
  return {names.begin(), names.end()};
}

Word<DatasetConfig> keypoints_3d_word() {
  return {
      [](const DatasetConfig& dataset) { return dataset.keypoints_3d_of_body ? "body" : "file"; },
      [](DatasetConfig& dataset, const std::string& word) { dataset.keypoints_3d_of_body = word == "body"; }};
}

Word<DatasetConfig> orientation_word() {
  return {[](const DatasetConfig& dataset) { return dataset.turns_by_exif ? "exif" : "stored"; },
          [](DatasetConfig& dataset, const std::string& word) { dataset.turns_by_exif = word == "exif"; }};
}

Word<DatasetConfig> resized_word() {
  return {[](const DatasetConfig& dataset) { return dataset.scales_resized ? "scale" : "refuse"; },
          [](DatasetConfig& dataset, const std::string& word) { dataset.scales_resized = word == "scale"; }};
}

}  // namespace

const Settings<BuildConfig>& build_settings() {
  static const Settings<BuildConfig> kSettings{
      {.key = "name",
       .member = &BuildConfig::name,
       .description =
           "first part of the name of the dataset's folder. It may hold letters, digits, `.`, `_` and `-`"},
      {.key = "version",
       .member = &BuildConfig::version,
       .description = "semantic version of the dataset. You raise it; it is part of the dataset's key"},
      {.key = "profile",
       .member = &BuildConfig::profile,
       .description =
           "the layer that the config starts from: `paper` is empty (the paper's rule alone). `strict` "
           "adapts every prediction that is kept (`tta.refine_retained`), with a term of the pose prior "
           "(`tta.pose_prior_weight` 0.003), and discards labels that are trusted little (`filter.min_trust` "
           "0.8). This made labels more accurate on rendered worlds (docs/results.md)",
       .words = profile_names()},
      {.key = "max_failed_share",
       .member = &BuildConfig::max_failed_share,
       .description =
           "share of the candidates that may fail. If more failed, as when a disk of pictures is not "
           "mounted, `build` exits with 1 and leaves `latest` where it was. 1 accepts any share",
       .range = {.least = 0, .most = 1}},
      {.key = "veto",
       .member = &BuildConfig::veto,
       .description = "a list of samples to leave out, see below. `build --veto FILE` replaces it"},
      {.key = "corrections",
       .member = &BuildConfig::corrections,
       .description = "keypoints that replace those of the annotation files, as `quadruped3d corrections` "
                      "writes them. `build --corrections FILE` replaces it. See docs/export.md"}};
  return kSettings;
}

const Settings<DatasetConfig>& dataset_settings() {
  static const Settings<DatasetConfig> kSettings{
      {.key = "name",
       .member = &DatasetConfig::name,
       .description = "first part of every sample id",
       .is_required = true},
      {.key = "format",
       .member = &DatasetConfig::format,
       .description =
           "`prima` (Animal3D, CtrlAni3D and every set in the same JSON form), `superanimal` (COCO with 39 "
           "keypoints), `animal_kingdom` (23 keypoints, MPII or COCO style), `stanfordextra`, `badja`; "
           "`coco`, `deeplabcut`, `sleap` and `lightning_pose` (any keypoints, described by a topology); "
           "`photographs` (no keypoints, for `predict` alone). See docs/datasets.md",
       .words = loaders::formats::dataset_formats(),
       .is_required = true},
      {.key = "root",
       .member = &DatasetConfig::root,
       .description =
           "folder of the dataset. Pictures and masks are looked up below it, and outside it only if "
           "`images` names a folder there",
       .is_required = true},
      {.key = "annotations",
       .member = &DatasetConfig::annotations,
       .description =
           "the annotation file, or for `deeplabcut` and `badja` also a folder of such files, relative to "
           "`root`",
       .is_required = true},
      {.key = "split", .member = &DatasetConfig::split, .description = "second part of every sample id"},
      {.key = "role",
       .member = word_of(&DatasetConfig::role, role_from_string),
       .description = "where the labels come from, see below",
       .words = role_names()},
      {.key = "images",
       .member = &DatasetConfig::images,
       .description =
           "folder of the pictures, relative to `root`. See docs/datasets.md for each format's default"},
      {.key = "orientation",
       .member = orientation_word(),
       .description =
           "`stored` takes labels for the pixels as they are stored; `exif` takes them for the pictures as "
           "their EXIF orientation turns them, and turns the pictures. See docs/own-labels.md",
       .words = {"stored", "exif"}},
      {.key = "resized",
       .member = resized_word(),
       .description =
           "what happens to labels whose file states another size than the picture has: `refuse` fails them "
           "as `size_mismatch`; `scale` scales box and keypoints if width and height differ by one factor",
       .words = {"refuse", "scale"}},
      {.key = "max_picture_megapixels",
       .member = &DatasetConfig::max_picture_megapixels,
       .description =
           "candidates whose picture has more millions of pixels fail as `image_too_large`. The picture's "
           "header is read for it, so that no memory is taken for a picture that only claims to be large",
       .range = {.least = 0, .most = 200, .is_open_below = true}},
      {.key = "curation",
       .member = &DatasetConfig::curation,
       .description =
           "a list written by `quadruped3d curate`; only the pictures that it chose are taken. See "
           "docs/datasets.md"},
      {.key = "body_model",
       .member = &DatasetConfig::body_model,
       .description =
           "for the role `truth` only: a SMAL asset (as in `network`) that checks the file's 3D keypoints, "
           "see below"},
      {.key = "keypoints_3d",
       .member = keypoints_3d_word(),
       .description =
           "`file` takes the 3D keypoints of the annotation file as labels; `body` takes those that the "
           "body model computes from pose and shape",
       .words = {"file", "body"}},
      {.key = "licence",
       .member = &DatasetConfig::licence,
       .description =
           "the licence of pictures and annotations, best as an SPDX identifier (`CC-BY-4.0`). The "
           "dataset and each of its shards repeat it"},
      {.key = "source_url",
       .member = &DatasetConfig::source_url,
       .description = "where the dataset came from. Repeated likewise"},
      {.key = "citation",
       .member = &DatasetConfig::citation,
       .description = "whom to cite for it, in words or as BibTeX. Repeated likewise"}};
  return kSettings;
}

const Settings<DatasetConfig>& own_label_settings() {
  static const Settings<DatasetConfig> kSettings{
      {.key = "topology",
       .member = &DatasetConfig::topology,
       .description =
           "a file that describes the keypoints, or the name of a built-in topology such as `ap10k` "
           "(`quadruped3d topology --list`). See docs/own-labels.md",
       .is_required = true},
      {.key = "categories",
       .member = &DatasetConfig::categories,
       .description =
           "`coco` only: names of the file's categories to take. Annotations of the others are left out"},
      {.key = "first_frame",
       .member = &DatasetConfig::first_frame,
       .description =
           "for tables whose rows number the frames of a video (not `coco`): the number of the picture that "
           "shows frame 0, 1 for pictures that ffmpeg numbered. Without it the pictures must have the "
           "frames' own numbers",
       .range = {.least = 0}},
      {.key = "species",
       .member = &DatasetConfig::species,
       .description =
           "species of all animals of the dataset. Without it the species comes from the file, if the file "
           "states one"},
      {.key = "min_confidence",
       .member = &DatasetConfig::min_confidence,
       .description = "keypoints with a lower confidence get weight 0; of the format `photographs`, boxes "
                      "with a lower score are left out",
       .range = {.least = 0, .most = 1}},
      {.key = "box_margin",
       .member = &DatasetConfig::box_margin,
       .description = "a box made from keypoints is enlarged on every side by this share of its longer side",
       .range = {.least = 0, .most = 2}}};
  return kSettings;
}

const Settings<NetworkConfig>& network_settings() {
  static const Settings<NetworkConfig> kSettings{
      {.key = "checkpoint",
       .member = &NetworkConfig::checkpoint,
       .description =
           "the network's weights: safetensors with the official parameter names. The file also holds the "
           "network's sizes",
       .is_required = true},
      {.key = "smal_asset",
       .member = &NetworkConfig::smal_asset,
       .description =
           "the body model as safetensors. docs/assets.md says how to get it, smal/tensors/asset.h describes "
           "its content",
       .is_required = true},
      {.key = "device",
       .member = &NetworkConfig::device,
       .description =
           "`auto` (a usable GPU, else the CPU), `cpu`, `cuda`, `cuda:I`, or one GPU for each rank, "
           "such as `cuda:0,cuda:1`"},
      {.key = "dtype",
       .member = word_of(&NetworkConfig::dtype, dtype_from_string),
       .description = "number type of the network",
       .words = texts(dtype_names()),
       .decides = DecidedStage::predict},
      {.key = "batch",
       .member = &NetworkConfig::batch,
       .description = "crops in one forward pass. A batch never crosses the border of a unit",
       .range = kAtLeastOne,
       .decides = DecidedStage::predict},
      {.key = "compute_threads",
       .member = &NetworkConfig::compute_threads,
       .description =
           "threads of one CPU operator. 0 chooses: one for a checkpoint below 64 MiB, whose operators are "
           "too short to share, and all cores for a larger one. The number can change the last bits of a "
           "result, so it is part of the results' key; `--threads` is not",
       .range = kNotNegative}};
  return kSettings;
}

const Settings<TtaConfig>& tta_settings() {
  static const Settings<TtaConfig> kSettings{
      {.key = "objective",
       .member = word_of(&TtaConfig::objective, tta_objective_from_string),
       .description =
           "what adaptation minimises. `paper`: 5.0 x the auxiliary keypoints' error + 0.5 x the "
           "reprojection error, both mean absolute errors. `demo`: the squared error of the projection "
           "alone, as in the released demo",
       .words = texts(tta_objective_names()),
       .decides = DecidedStage::refine},
      {.key = "learning_rate",
       .member = &TtaConfig::learning_rate,
       .description =
           "learning rate of Adam. The default suits the official weights of width 1280. A small network "
           "needs a larger one, because the learning rate bounds Adam's step",
       .range = kPositive,
       .decides = DecidedStage::refine},
      {.key = "aux_weight",
       .member = &TtaConfig::aux_weight,
       .description = "weight of the auxiliary keypoints' error in the `paper` objective",
       .decides = DecidedStage::refine},
      {.key = "reproj_weight",
       .member = &TtaConfig::reproj_weight,
       .description = "weight of the reprojection error in the `paper` objective",
       .decides = DecidedStage::refine},
      {.key = "pose_prior_weight",
       .member = &TtaConfig::pose_prior_weight,
       .description =
           "weight of the mean square of the whitened pose, which keeps poses near those that animals take. "
           "The paper has no such term. Needs priors (`guards.priors`)",
       .range = kNotNegative,
       .decides = DecidedStage::refine},
      {.key = "shape_prior_weight",
       .member = &TtaConfig::shape_prior_weight,
       .description = "the same for the betas, by the statistics of the nearest family",
       .range = kNotNegative,
       .decides = DecidedStage::refine},
      {.key = "iterations_min",
       .member = &TtaConfig::iterations_min,
       .description =
           "number of iterations at an initial error of `tau_low`; it grows linearly with the error",
       .range = kAtLeastOne,
       .decides = DecidedStage::refine},
      {.key = "iterations_max",
       .member = &TtaConfig::iterations_max,
       .description = "number of iterations at an initial error of `tau_high`",
       .range = kAtLeastOne,
       .decides = DecidedStage::refine},
      {.key = "stop_below",
       .member = &TtaConfig::stop_below,
       .description =
           "crop units. Adaptation ends as soon as L_proj is below it; 0 is never, as in the paper. At "
           "most `tau_low`. A sample that ends there before the tenth iteration is kept without the test "
           "of `delta`. With the value of `tau_low` this was the rule until version 0.2; it saves time, "
           "and labels are hardly better than predictions (docs/experiments.md)",
       .range = kNotNegative,
       .decides = DecidedStage::refine},
      {.key = "refine_retained",
       .member = &TtaConfig::refine_retained,
       .description =
           "if true, predictions below `tau_low` are adapted too, for `iterations_min` iterations and "
           "without the test of `delta`. Each is kept in any case: as refined if an iterate is better, "
           "else as retained. The paper retains them as they are",
       .decides = DecidedStage::refine},
      {.key = "batch",
       .member = &TtaConfig::batch,
       .description = "samples that are adapted together",
       .range = kAtLeastOne,
       .decides = DecidedStage::refine}};
  return kSettings;
}

const Settings<FilterConfig>& filter_settings() {
  static const Settings<FilterConfig> kSettings{
      {.key = "tau_low",
       .member = &FilterConfig::tau_low,
       .description = "crop units. A prediction with L_proj below it is retained. `calibrate` finds it"},
      {.key = "tau_high",
       .member = &FilterConfig::tau_high,
       .description =
           "crop units. A prediction with this L_proj or more is discarded, one between the two taus is "
           "adapted. A build without thresholds stops and names `calibrate`"},
      {.key = "delta",
       .member = &FilterConfig::delta,
       .description = "relative gain that adaptation must reach within ten iterations"},
      {.key = "tau_ceiling",
       .member = &FilterConfig::tau_ceiling,
       .description =
           "crop units. `calibrate` and `build` refuse a `tau_high` above it with exit code 1, because "
           "shares can be met on any pictures. At the default, a keypoint of the worst adapted sample is "
           "a tenth of the crop's side off in each direction, about the length of a lower leg; a body in "
           "the middle of the crop that knows nothing of the picture is about 0.2 off. `--above-ceiling` "
           "goes on all the same",
       .range = kPositive},
      {.key = "min_trust",
       .member = &FilterConfig::min_trust,
       .description = "discards labels whose combined trust score is below it (`trust_too_low`); 0 is off. "
                      "docs/filters.md explains the score",
       .range = {.least = 0, .most = 1}}};
  return kSettings;
}

const Settings<DatasetThresholds>& dataset_threshold_settings() {
  static const Settings<DatasetThresholds> kSettings{
      {.key = "tau_low", .member = &DatasetThresholds::tau_low, .description = "as in `filter`"},
      {.key = "tau_high", .member = &DatasetThresholds::tau_high, .description = "as in `filter`"},
      {.key = "delta", .member = &DatasetThresholds::delta, .description = "as in `filter`"}};
  return kSettings;
}

const Settings<GuardConfig>& guard_settings() {
  static const Settings<GuardConfig> kSettings{
      {.key = "visible_min",
       .member = &GuardConfig::visible_min,
       .description = "discards labels with fewer visible keypoints than this (`too_few_keypoints`)",
       .range = {.least = 0, .most = smal::kNumKeypoints}},
      {.key = "iterations_full_at",
       .member = &GuardConfig::iterations_full_at,
       .description =
           "shortens the adaptation of samples with few keypoints: a sample with v visible keypoints gets v "
           "/ `iterations_full_at` of its iterations (rounded, at least 1), and all of them from "
           "`iterations_full_at` keypoints on. A sample that misses the gain is discarded as "
           "`scaled_gain_too_small` if it had fewer than the gain's ten iterations",
       .range = {.least = 0, .most = smal::kNumKeypoints}},
      {.key = "held_out_share",
       .member = &GuardConfig::held_out_share,
       .description =
           "share of the visible keypoints that adaptation does not see (rounded, at least one, never all). "
           "The iterate with the least error on them is kept. If that is the prediction itself, the sample "
           "is discarded as `held_out_not_better`; a sample with a single visible keypoint is discarded too",
       .range = {.least = 0, .most = 1, .is_open_above = true}},
      {.key = "held_out_seed",
       .member = &GuardConfig::held_out_seed,
       .description = "together with the sample id it decides which keypoints are held out"},
      {.key = "held_out_patience",
       .member = &GuardConfig::held_out_patience,
       .description =
           "adaptation stops after this many iterations without a new least held-out error; 0 is no limit",
       .range = kNotNegative},
      {.key = "pose_deviation_max",
       .member = &GuardConfig::pose_deviation_max,
       .description =
           "discards poses that lie further from the pose prior than this many standard deviations (root "
           "mean square over the body's 102 numbers) (`pose_implausible`)",
       .range = kNotNegative},
      {.key = "limb_factor_max",
       .member = &GuardConfig::limb_factor_max,
       .description =
           "discards bodies in which a leg bone, relative to the spine, is longer or shorter than in every "
           "family's mean body by more than this factor (`limbs_implausible`)",
       .range = kNotNegative},
      {.key = "left_right_max",
       .member = &GuardConfig::left_right_max,
       .description =
           "discards labels whose error, over pairs of left and right keypoints, is more than this many "
           "times the error with left and right exchanged. With 1, a label only has to fit better as "
           "annotated than exchanged (`left_right_swapped`)",
       .range = kNotNegative},
      {.key = "mask_iou_min",
       .member = &GuardConfig::mask_iou_min,
       .description =
           "discards labels whose silhouette has a smaller intersection over union with the mask, in the "
           "network's crop (`mask_mismatch`). A sample without a mask passes",
       .range = {.least = 0, .most = 1}},
      {.key = "priors",
       .member = &GuardConfig::priors,
       .description =
           "safetensors with `pose_prior_loss.*` and `shape_prior_loss.*`, for `pose_deviation_max` and "
           "`limb_factor_max`; the checkpoint unless given. An official checkpoint holds them; `quadruped3d "
           "init --priors FILE` writes those of the synthetic quadruped"}};
  return kSettings;
}

const Settings<ShardConfig>& shard_settings() {
  static const Settings<ShardConfig> kSettings{
      {.key = "unit_size",
       .member = &ShardConfig::unit_size,
       .description =
           "number of candidates of one work unit. A unit becomes one shard, and a stopped build loses at "
           "most its open units. 64 suits the full-size network on a CPU",
       .range = {.least = 1, .most = 65536},
       .decides = DecidedStage::predict},
      {.key = "images",
       .member = word_of(&ShardConfig::images, manifests::image_encoding_from_string),
       .description =
           "how pictures are stored. `reference` stores no pictures, so that labels can be shared even if "
           "the pictures must not be",
       .words = texts(manifests::image_encoding_names()),
       .decides = DecidedStage::shards},
      {.key = "jpeg_quality",
       .member = &ShardConfig::jpeg_quality,
       .description = "quality of stored JPEGs",
       .range = {.least = 1, .most = 100},
       .decides = DecidedStage::shards},
      {.key = "crop_scale",
       .member = &ShardConfig::crop_scale,
       .description =
           "side of the stored crop, as a multiple of the box's longer side. The default is as far as "
           "training's augmentation reaches",
       .range = {.least = 1, .most = 4},
       .decides = DecidedStage::shards},
      {.key = "crop_min_side_px",
       .member = &ShardConfig::crop_min_side_px,
       .description = "side of the stored crop in pixels, unless the source has fewer pixels there",
       .range = {.least = smal::kCropSidePx, .most = 2048},
       .decides = DecidedStage::shards}};
  return kSettings;
}

const Settings<LeakageConfig>& leakage_settings() {
  static const Settings<LeakageConfig> kSettings{
      {.key = "max_distance",
       .member = &LeakageConfig::max_distance,
       .description =
           "two pictures count as copies if their 64-bit perceptual hashes differ in at most this many bits",
       .range = {.least = 0, .most = filters::kMaxHashDistance}}};
  return kSettings;
}

const Settings<CalibrateConfig>& calibrate_settings() {
  static const Settings<CalibrateConfig> kSettings{
      {.key = "retained",
       .member = &CalibrateConfig::retained,
       .description =
           "target share of the judged candidates that are retained. The default is the paper's: 5K of 14K",
       .range = {.least = 0, .most = 1, .is_open_below = true, .is_open_above = true}},
      {.key = "refined",
       .member = &CalibrateConfig::refined,
       .description =
           "target share of the judged candidates that are refined. The default is the paper's: 4K of 14K",
       .range = {.least = 0, .most = 1, .is_open_below = true, .is_open_above = true}},
      {.key = "per_dataset",
       .member = &CalibrateConfig::per_dataset,
       .description =
           "if true, every dataset with pseudo labels gets its own thresholds, and each dataset meets the "
           "shares by itself"}};
  return kSettings;
}

}  // namespace q3d::pipeline::config
