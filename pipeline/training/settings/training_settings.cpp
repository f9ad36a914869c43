#include "pipeline/training/settings/training_settings.h"

namespace q3d::pipeline::training::settings {
namespace {

using config::DecidedStage;
using config::Range;
using config::Settings;
using config::Word;
using loaders::pictures::AugmentOptions;
using model::settings::LossVariant;
using model::settings::LossWeights;

constexpr int kMostStemBlocks = 11;  // of an EfficientNetLite (model/efficientnet_lite.h)
constexpr Range kAtLeastOne{.least = 1};
constexpr Range kNotNegative{.least = 0};
constexpr Range kShare{.least = 0, .most = 1};
constexpr Range kBelowOne{.least = 0, .most = 1, .is_open_above = true};

std::vector<std::string> texts(std::span<const std::string_view> words) {
  return {words.begin(), words.end()};
}

// Makes the access to a member that is an enum from the functions that name its values.
template <typename Struct, typename Enum>
Word<Struct> enum_word(Enum Struct::*member, std::string_view (*name)(Enum),
                       Enum (*value)(std::string_view)) {
  return {[=](const Struct& config) { return std::string(name(config.*member)); },
          [=](Struct& config, const std::string& word) { config.*member = value(word); }};
}

Word<feed::FeedOptions> keypoint_weight_word() {
  using feed::KeypointWeight;
  return {[](const feed::FeedOptions& options) {
            return options.keypoint_weight == KeypointWeight::raw_v ? "raw_v" : "label";
          },
          [](feed::FeedOptions& options, const std::string& word) {
            options.keypoint_weight = word == "raw_v" ? KeypointWeight::raw_v : KeypointWeight::label;
          }};
}

}  // namespace

const Settings<TrainingConfig>& training_settings() {
  static const Settings<TrainingConfig> kSettings{
      {.key = "batch_parts",
       .member = &TrainingConfig::batch_parts,
       .description =
           "saves memory: a rank computes its samples of a batch in so many parts, one after the other, and "
           "every part once more for its gradients. The gradients are those of the whole batch, rounded "
           "differently; only dropout draws otherwise",
       .range = {.least = 1, .most = 65536},
       .decides = DecidedStage::weights},
      {.key = "feed_ahead",
       .member = &TrainingConfig::feed_ahead,
       .description = "number of batches that are prepared in the background",
       .range = {.least = 0, .most = 64}},
      {.key = "loss_variant",
       .member =
           enum_word<TrainingConfig, LossVariant>(&TrainingConfig::loss_variant, &model::settings::to_string,
                                                  &model::settings::loss_variant_from_string),
       .description =
           "`official` reproduces two faults of the released code: gradients are NaN if a predicted joint is "
           "not rotated at all, and samples without truth are shown to the discriminator as real animals",
       .words = model::settings::loss_variant_names(),
       .decides = DecidedStage::weights},
      {.key = "backbone_rate",
       .member = &TrainingConfig::backbone_rate,
       .description =
           "learning rate of the backbone as a share of the head's (the paper: a tenth), in phases "
           "with the objective `prima`",
       .range = kNotNegative,
       .decides = DecidedStage::weights},
      {.key = "stem_rate",
       .member = &TrainingConfig::stem_rate,
       .description =
           "learning rate of a pre-trained EfficientNet stem as a share of the rate of the encoder that it "
           "belongs to, in all phases. Weights that know pictures already need small steps",
       .range = kNotNegative,
       .decides = DecidedStage::weights},
      {.key = "frozen_stem_blocks",
       .member = &TrainingConfig::frozen_stem_blocks,
       .description = "the first convolution and so many of the 11 blocks of an EfficientNet stem keep their "
                      "values. The first blocks see the most pixels, so freezing them saves much of a step's "
                      "time; 0 freezes nothing",
       .range = {.least = 0, .most = kMostStemBlocks},
       .decides = DecidedStage::weights},
      {.key = "weight_decay",
       .member = &TrainingConfig::weight_decay,
       .description = "weight decay of AdamW, on all parameters",
       .range = kNotNegative,
       .decides = DecidedStage::weights},
      {.key = "largest_gradient_norm",
       .member = &TrainingConfig::largest_gradient_norm,
       .description = "gradients with a larger L2 norm are scaled down to this norm; 0 never scales them",
       .range = kNotNegative,
       .decides = DecidedStage::weights},
      {.key = "divergence_factor",
       .member = &TrainingConfig::divergence_factor,
       .description = "a loss that exceeds its running mean by this factor stops the run",
       .range = {.least = 1, .is_open_below = true}},
      {.key = "model_dtype",
       .member = enum_word<TrainingConfig, ModelDtype>(&TrainingConfig::model_dtype, &to_string,
                                                       &model_dtype_from_string),
       .description = "number type of the finished weights' file; `float16` halves its size",
       .words = texts(model_dtype_names()),
       .decides = DecidedStage::weights},
      {.key = "seed",
       .member = &TrainingConfig::seed,
       .description = "seed of drawing, augmentation, dropout and the discriminator",
       .decides = DecidedStage::weights},
      {.key = "checkpoint_every",
       .member = &TrainingConfig::checkpoint_every,
       .description = "number of steps between two saved states",
       .range = kAtLeastOne},
      {.key = "log_every",
       .member = &TrainingConfig::log_every,
       .description = "number of steps between two log lines",
       .range = kAtLeastOne}};
  return kSettings;
}

const Settings<TrainingNetworkConfig>& training_network_settings() {
  using Config = TrainingNetworkConfig;
  static const Settings<Config> kSettings{
      {.key = "initial",
       .member = &Config::initial,
       .description =
           "path of the checkpoint that training starts from; `quadruped3d init` makes a fresh one. "
           "The file also holds the network's sizes and switches",
       .is_required = true},
      {.key = "encoders",
       .member = &Config::encoders,
       .description =
           "path of a checkpoint whose two image encoders replace those of `initial`. The result is "
           "a fresh head on pre-trained encoders"},
      {.key = "without",
       .member = &Config::without,
       .description =
           "the paper's ablations: `bio_features` (no F_bio: the bio encoder starts from random weights and "
           "is trained along with the rest), `initial_betas` (no beta_init: betas start from zero), "
           "`keypoint_tokens` (neither keypoint tokens nor auxiliary keypoints). The trained checkpoint "
           "records them",
       .words = {"bio_features", "initial_betas", "keypoint_tokens"},
       .decides = DecidedStage::weights},
      {.key = "smal_asset",
       .member = &Config::smal_asset,
       .description = "path of the body model",
       .is_required = true},
      {.key = "priors",
       .member = &Config::priors,
       .description =
           "path of a safetensors file with `pose_prior_loss.*` and `shape_prior_loss.*`; an "
           "official checkpoint holds them too, and `quadruped3d init --priors FILE` writes those of "
           "the synthetic quadruped",
       .is_required = true},
      {.key = "device",
       .member = &Config::device,
       .description =
           "`auto` (a usable GPU, else the CPU), `cpu`, `cuda`, `cuda:I`, or one GPU for each rank, "
           "such as `cuda:0,cuda:1`"},
      {.key = "precision",
       .member = enum_word<Config, Precision>(&Config::precision, &to_string, &precision_from_string),
       .description =
           "number type of the forward pass's matrix products. `bfloat16` uses LibTorch's autocast; weights, "
           "losses, body model and optimiser stay in float32. On x86 it is faster only if the processor "
           "multiplies in bfloat16 (AVX512_BF16), on Intel's only if it has AMX too. Without AVX-512, "
           "LibTorch's bfloat16 convolutions are about ten times slower than float32, and a warning says "
           "so. `auto` takes bfloat16 on a GPU or such a processor, else float32",
       .words = texts(precision_names()),
       .decides = DecidedStage::weights},
      {.key = "compute_threads",
       .member = &Config::compute_threads,
       .description = "threads of one CPU operator; 0 takes all cores. They can change the last bits of a "
                      "result",
       .range = kNotNegative},
      {.key = "recompute",
       .member = &Config::recompute,
       .description = "saves memory: of each block of the ViT, only the input is kept, and the backward pass "
                      "computes the block again. The weights are the same to the bit"}};
  return kSettings;
}

const Settings<PoolConfig>& pool_settings() {
  static const Settings<PoolConfig> kSettings{
      {.key = "shards",
       .member = &PoolConfig::shards,
       .description =
           "shard files, or folders that contain `*.h5` files directly or in a subfolder `shards`; "
           "the folder of a dataset therefore works",
       .is_required = true},
      {.key = "weight",
       .member = &PoolConfig::weight,
       .description = "weight of each sample of the pool",
       .range = kNotNegative,
       .decides = DecidedStage::weights}};
  return kSettings;
}

const Settings<PhaseConfig>& phase_settings() {
  static const Settings<PhaseConfig> kSettings{
      {.key = "name",
       .member = &PhaseConfig::name,
       .description = "name of the phase in the log",
       .is_required = true,
       .decides = DecidedStage::weights},
      {.key = "objective",
       .member =
           enum_word<PhaseConfig, Objective>(&PhaseConfig::objective, &to_string, &objective_from_string),
       .description = "`prima` trains the network with the losses below; `encoders` pre-trains the two image "
                      "encoders, see below",
       .words = texts(objective_names()),
       .decides = DecidedStage::weights},
      {.key = "pools",
       .member = &PhaseConfig::pool_names,
       .description = "names of pools",
       .is_required = true},
      {.key = "steps",
       .member = &PhaseConfig::steps,
       .description = "number of batches",
       .range = kAtLeastOne,
       .is_required = true,
       .decides = DecidedStage::weights},
      {.key = "ief_iterations",
       .member = &PhaseConfig::ief_iterations,
       .description = "iterations of iterative error feedback (IEF); the paper uses 3 in the warm-up",
       .range = {.least = 1, .most = 16},
       .decides = DecidedStage::weights},
      {.key = "adversarial",
       .member = &PhaseConfig::adversarial,
       .description = "also trains a discriminator and adds its loss, as the paper does in the warm-up",
       .decides = DecidedStage::weights},
      {.key = "learning_rate",
       .member = &PhaseConfig::learning_rate,
       .description = "learning rate of the head. The backbone's is `backbone_rate` times this",
       .range = {.least = 0, .is_open_below = true},
       .decides = DecidedStage::weights},
      {.key = "warm_up_steps",
       .member = &PhaseConfig::warm_up_steps,
       .description = "during these steps the rate rises linearly to `learning_rate`; they are fewer than "
                      "`steps`",
       .range = kNotNegative,
       .decides = DecidedStage::weights},
      {.key = "decay",
       .member = enum_word<PhaseConfig, Decay>(&PhaseConfig::decay, &to_string, &decay_from_string),
       .description =
           "`linear` lets the rate fall to zero at the end of the phase (the paper); `none` keeps it "
           "constant (the official code)",
       .words = texts(decay_names()),
       .decides = DecidedStage::weights}};
  return kSettings;
}

const Settings<feed::FeedOptions>& feed_settings() {
  using Options = feed::FeedOptions;
  static const Settings<Options> kSettings{
      {.key = "batch",
       .member = &Options::batch,
       .description = "samples of one step, over all ranks together. Keypoint and parameter losses are sums "
                      "over the batch, so a learning rate fits one batch size only",
       .range = {.least = 1, .most = 65536},
       .decides = DecidedStage::weights},
      {.key = "augment",
       .member = &Options::augment,
       .description = "random scale, rotation, shift and colour, as in the official code",
       .decides = DecidedStage::weights},
      {.key = "keypoint_weight",
       .member = keypoint_weight_word(),
       .description = "weight of a 2D keypoint. `label` takes the shard's weight: 1, or a detector's "
                      "likelihood. `raw_v` takes the annotation's `v`, as the official code does (negative "
                      "numbers count as 0)",
       .words = {"label", "raw_v"},
       .decides = DecidedStage::weights}};
  return kSettings;
}

const Settings<AugmentOptions>& augmentation_settings() {
  static const Settings<AugmentOptions> kSettings{
      {.key = "scale",
       .member = &AugmentOptions::scale,
       .description = "the box is scaled by 1 plus or minus up to this",
       .range = kBelowOne,
       .decides = DecidedStage::weights},
      {.key = "rotation_deg",
       .member = &AugmentOptions::rotation_deg,
       .description = "standard deviation of the rotation in degrees, which is cut at two of them",
       .range = {.least = 0, .most = 90},
       .decides = DecidedStage::weights},
      {.key = "rotation_rate",
       .member = &AugmentOptions::rotation_rate,
       .description = "share of the samples that are rotated",
       .range = kShare,
       .decides = DecidedStage::weights},
      {.key = "shift",
       .member = &AugmentOptions::shift,
       .description = "the box is shifted on each axis by up to this share of its side",
       .range = kBelowOne,
       .decides = DecidedStage::weights},
      {.key = "colour",
       .member = &AugmentOptions::colour,
       .description = "each colour channel is multiplied by 1 plus or minus up to this",
       .range = kBelowOne,
       .decides = DecidedStage::weights},
      {.key = "mirror_rate",
       .member = &AugmentOptions::mirror_rate,
       .description = "share of the samples whose picture and labels are mirrored left to right, which the "
                      "official code does not do",
       .range = kShare,
       .decides = DecidedStage::weights}};
  return kSettings;
}

const Settings<DomainConfig>& domain_settings() {
  static const Settings<DomainConfig> kSettings{
      {.key = "pictures",
       .member = &DomainConfig::pictures,
       .description =
           "kind of the pictures that the network is trained on. `build` and `calibrate` warn if a "
           "network that knows rendered pictures alone meets photographs",
       .words = {"photographs", "rendered"},
       .is_required = true},
      {.key = "trained_on",
       .member = &DomainConfig::trained_on,
       .description = "for people: which data these are",
       .is_required = true},
      {.key = "held_out",
       .member = &DomainConfig::held_out,
       .description =
           "name of a pool that the stage does not train on. The finished network predicts draws "
           "from it, and the quantiles of their L_proj are stored; `build` and `calibrate` warn if "
           "a pool's errors lie far outside them"},
      {.key = "samples",
       .member = &DomainConfig::samples,
       .description = "number of draws from the held-out pool, with replacement",
       .range = {.least = 20, .most = 1000000}}};
  return kSettings;
}

const Settings<LossWeights>& loss_weight_settings() {
  const auto weight = [](const char* key, double LossWeights::*member, const char* of) {
    return config::Setting<LossWeights>{
        .key = key, .member = member, .description = of, .decides = DecidedStage::weights};
  };
  static const Settings<LossWeights> kSettings{
      weight("keypoints_3d", &LossWeights::keypoints_3d, "3D keypoints of the body"),
      weight("keypoints_2d", &LossWeights::keypoints_2d, "2D keypoints of the body"),
      weight("aux_keypoints_2d", &LossWeights::aux_keypoints_2d, "2D keypoints of the decoder's tokens"),
      weight("aux_keypoints_3d", &LossWeights::aux_keypoints_3d, "3D keypoints of the decoder's tokens"),
      weight("global_orient", &LossWeights::global_orient, "rotation of the root"),
      weight("pose", &LossWeights::pose, "rotations of the other joints"),
      weight("betas", &LossWeights::betas, "shape"),
      weight("contrastive", &LossWeights::contrastive, "supervised contrastive loss of the shape features"),
      weight("adversarial", &LossWeights::adversarial, "the discriminator's verdict, in adversarial phases")};
  return kSettings;
}

config::SettingsTables training_settings_tables() {
  std::vector<config::SettingFacts> top = config::facts_of(feed_settings());
  for (config::SettingFacts facts : config::facts_of(training_settings())) top.push_back(std::move(facts));
  return {{"training", std::move(top)},
          {"training network", config::facts_of(training_network_settings())},
          {"pools", config::facts_of(pool_settings())},
          {"phases", config::facts_of(phase_settings())},
          {"augmentation", config::facts_of(augmentation_settings())},
          {"domain", config::facts_of(domain_settings())},
          {"loss weights", config::facts_of(loss_weight_settings())}};
}

}  // namespace q3d::pipeline::training::settings
