#include "model/config.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <tuple>
#include <variant>
#include <vector>

#include "manifests/spelling.h"

namespace q3d::model {
namespace {

using Member = std::variant<std::int64_t PrimaConfig::*, double PrimaConfig::*, bool PrimaConfig::*>;

struct Field {
  std::string_view key;
  Member member;
  std::int64_t least = 1;  // least value of a size
};

constexpr std::array kFields{
    Field{"embed_dim", &PrimaConfig::embed_dim},
    Field{"depth", &PrimaConfig::depth},
    Field{"heads", &PrimaConfig::heads},
    Field{"mlp_ratio", &PrimaConfig::mlp_ratio},
    Field{"stem_depth", &PrimaConfig::stem_depth, 0},
    Field{"efficientnet_stem", &PrimaConfig::efficientnet_stem},
    Field{"clip_width", &PrimaConfig::clip_width},
    Field{"clip_layers", &PrimaConfig::clip_layers},
    Field{"clip_heads", &PrimaConfig::clip_heads},
    Field{"clip_out", &PrimaConfig::clip_out},
    Field{"clip_quick_gelu", &PrimaConfig::clip_quick_gelu},
    Field{"clip_stem_depth", &PrimaConfig::clip_stem_depth, 0},
    Field{"clip_efficientnet_stem", &PrimaConfig::clip_efficientnet_stem},
    Field{"dec_dim", &PrimaConfig::dec_dim},
    Field{"dec_layers", &PrimaConfig::dec_layers},
    Field{"dec_heads", &PrimaConfig::dec_heads},
    Field{"dec_ffn", &PrimaConfig::dec_ffn},
    Field{"ief_iterations", &PrimaConfig::ief_iterations},
    Field{"focal_px", &PrimaConfig::focal_px},
    Field{"learn_bio_encoder", &PrimaConfig::learn_bio_encoder},
    Field{"betas_from_bio", &PrimaConfig::betas_from_bio},
    Field{"keypoint_tokens", &PrimaConfig::keypoint_tokens},
    Field{"true_token_grid", &PrimaConfig::true_token_grid},
    Field{"drop_path", &PrimaConfig::drop_path},
    Field{"dropout", &PrimaConfig::dropout},
};

const Field& find_field(const std::string& key) {
  const auto found =
      std::find_if(kFields.begin(), kFields.end(), [&](const Field& f) { return f.key == key; });
  if (found != kFields.end()) return *found;
  std::vector<std::string> keys;
  for (const Field& field : kFields) keys.emplace_back(field.key);
  throw std::invalid_argument(fmt::format("model config: unknown key '{}'; did you mean '{}'?", key,
                                          manifests::nearest_word(key, keys)));
}

void require_type(const std::string& key, const nlohmann::json& value, bool fits, std::string_view expected) {
  if (!fits) {
    throw std::invalid_argument(
        fmt::format("model config: '{}' must be {}, got {}", key, expected, value.dump()));
  }
}

void require(bool holds, const std::string& message) {
  if (!holds) throw std::invalid_argument("model config: " + message);
}

void require_divides(std::string_view part, std::int64_t divisor, std::string_view whole,
                     std::int64_t dividend) {
  require(dividend % divisor == 0,
          fmt::format("'{}' = {} does not divide '{}' = {}", part, divisor, whole, dividend));
}

}  // namespace

PrimaConfig named_config(const std::string& name) {
  PrimaConfig config;
  if (name == "vith") return config;
  if (name == "small") {  // trains from scratch on two CPU cores
    config.embed_dim = 128, config.depth = 2, config.heads = 4, config.stem_depth = 4;
    config.clip_width = 64, config.clip_layers = 2, config.clip_heads = 2, config.clip_out = 64;
    config.clip_stem_depth = 2;
    config.dec_dim = 128, config.dec_layers = 3, config.dec_heads = 4, config.dec_ffn = 384;
    config.drop_path = 0.05;  // two blocks cannot spare half of themselves
    config.true_token_grid = true;
    return config;
  }
  if (name == "lite") {  // both encoders start from an EfficientNet-Lite0 that knows photographs
    config = named_config("small");
    config.stem_depth = 0, config.efficientnet_stem = true;
    config.clip_stem_depth = 0, config.clip_efficientnet_stem = true;
    return config;
  }
  if (name == "tiny") {
    config.embed_dim = 64, config.depth = 2, config.heads = 4;
    config.clip_width = 64, config.clip_layers = 2, config.clip_heads = 4, config.clip_out = 32;
    config.dec_dim = 64, config.dec_layers = 2, config.dec_heads = 4, config.dec_ffn = 256;
    return config;
  }
  throw std::invalid_argument(
      fmt::format("model size '{}' is unknown; known sizes: vith, small, lite, tiny", name));
}

void check_config(const PrimaConfig& config) {
  constexpr std::int64_t kLargest = 1 << 16;  // far above any real width; keeps products inside 64 bits
  for (const Field& field : kFields) {
    if (const auto* size = std::get_if<std::int64_t PrimaConfig::*>(&field.member)) {
      require(
          config.*(*size) >= field.least && config.*(*size) <= kLargest,
          fmt::format("'{}' = {} lies outside [{}, {}]", field.key, config.*(*size), field.least, kLargest));
    }
  }
  require_divides("heads", config.heads, "embed_dim", config.embed_dim);
  require_divides("clip_heads", config.clip_heads, "clip_width", config.clip_width);
  require_divides("dec_heads", config.dec_heads, "dec_dim", config.dec_dim);
  for (const auto& [key, depth, other, efficientnet] :
       {std::tuple{"stem_depth", config.stem_depth, "efficientnet_stem", config.efficientnet_stem},
        std::tuple{"clip_stem_depth", config.clip_stem_depth, "clip_efficientnet_stem",
                   config.clip_efficientnet_stem}}) {
    require(depth == 0 || !efficientnet,
            fmt::format("'{}' = {} and '{}' exclude each other", key, depth, other));
  }
  // A stem's first maps have a quarter of the width; its group norms take 16 channels together.
  for (const auto& [key, depth, width] :
       {std::tuple{"embed_dim", config.stem_depth, config.embed_dim},
        std::tuple{"clip_width", config.clip_stem_depth, config.clip_width}}) {
    require(depth == 0 || width % 64 == 0,
            fmt::format("a stem needs '{}' = {} to be a multiple of 64", key, width));
  }
  // The position encoding holds a sine and a cosine for each of two axes.
  require(config.dec_dim % 4 == 0, fmt::format("'dec_dim' = {} is no multiple of 4", config.dec_dim));
  // Keypoints are read after every layer but the last, so one layer alone would predict none.
  require(config.dec_layers >= 2, "'dec_layers' must be at least 2");
  require(std::isfinite(config.focal_px) && config.focal_px > 0.0,
          fmt::format("'focal_px' = {} is not a positive length", config.focal_px));
  for (const double rate : {config.drop_path, config.dropout}) {
    require(rate >= 0.0 && rate < 1.0,
            fmt::format("'drop_path' and 'dropout' must lie in [0, 1), got {}", rate));
  }
}

PrimaConfig config_from_json(const nlohmann::json& json) {
  if (!json.is_object()) {
    throw std::invalid_argument(fmt::format("model config: expected an object, got {}", json.type_name()));
  }
  PrimaConfig config;
  for (const auto& [key, value] : json.items()) {
    const Member member = find_field(key).member;
    if (const auto* size = std::get_if<std::int64_t PrimaConfig::*>(&member)) {
      require_type(key, value, value.is_number_integer(), "an integer");
      config.*(*size) = value.get<std::int64_t>();
    } else if (const auto* real = std::get_if<double PrimaConfig::*>(&member)) {
      require_type(key, value, value.is_number(), "a number");
      config.*(*real) = value.get<double>();
    } else {
      require_type(key, value, value.is_boolean(), "true or false");
      config.*std::get<bool PrimaConfig::*>(member) = value.get<bool>();
    }
  }
  check_config(config);
  return config;
}

nlohmann::json to_json(const PrimaConfig& config) {
  nlohmann::json json = nlohmann::json::object();
  for (const Field& field : kFields) {
    std::visit([&](auto member) { json[std::string(field.key)] = config.*member; }, field.member);
  }
  return json;
}

}  // namespace q3d::model
