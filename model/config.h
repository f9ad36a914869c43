// Sizes and switches of the PRIMA network, and their JSON form.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <string>

namespace q3d::model {

struct PrimaConfig {
  // ViT backbone
  std::int64_t embed_dim = 1280;
  std::int64_t depth = 32;
  std::int64_t heads = 16;
  std::int64_t mlp_ratio = 4;
  // At most one of these two stems may be set. Without them, the official patch projection is used.
  std::int64_t stem_depth = 0;     // of a convolutional stem (model/conv_stem.h)
  bool efficientnet_stem = false;  // the first part of EfficientNet-Lite0 (model/efficientnet_lite.h)
  // BioCLIP visual encoder
  std::int64_t clip_width = 768;
  std::int64_t clip_layers = 12;
  std::int64_t clip_heads = 12;
  std::int64_t clip_out = 512;
  bool clip_quick_gelu = false;
  std::int64_t clip_stem_depth = 0;     // as stem_depth
  bool clip_efficientnet_stem = false;  // as efficientnet_stem
  // keypoint-aware decoder
  std::int64_t dec_dim = 1280;
  std::int64_t dec_layers = 6;
  std::int64_t dec_heads = 8;
  std::int64_t dec_ffn = 5120;
  std::int64_t ief_iterations = 1;
  double focal_px = 1000.0;  // at the 256-px crop
  // The paper's ablations. They do not change the set of parameters.
  bool learn_bio_encoder =
      false;                    // true: without F_bio, an encoder trained from random weights takes its place
  bool betas_from_bio = true;   // false: without beta_init, the betas start from zero
  bool keypoint_tokens = true;  // false: without T_keypoint, no keypoint token nor auxiliary keypoint
  // False: the decoder reads the image tokens as 12 rows of 16, as the released weights need it. True: it
  // reads them in their real layout, 16 rows of 12, so that positions and sampling are geometrically correct.
  // This is for weights trained from scratch.
  bool true_token_grid = false;
  // training only
  double drop_path = 0.55;  // of the last ViT block; rises linearly from 0 at the first
  double dropout = 0.1;     // in the decoder layers, attention included

  bool operator==(const PrimaConfig&) const = default;
};

// Named sizes: "vith" (the paper's), "small", "lite" (small with an EfficientNet stem) and "tiny". Throws
// std::invalid_argument that lists the known names.
PrimaConfig named_config(const std::string& name);

// Throws std::invalid_argument when two sizes do not fit together (heads that do not divide the width, ...).
void check_config(const PrimaConfig& config);

// Reads a config. Absent keys keep the paper's value. Throws std::invalid_argument for an unknown key (naming
// the nearest known one), for a wrong type, and as check_config does.
PrimaConfig config_from_json(const nlohmann::json& json);
nlohmann::json to_json(const PrimaConfig& config);

}  // namespace q3d::model
