#include "model/checkpoint.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "manifests/durability.h"
#include "manifests/json_parse.h"

namespace q3d::model {
namespace {

constexpr const char* kConfigKey = "prima_config";

std::string shape_text(at::IntArrayRef shape) {
  std::string text = "[";
  for (const std::int64_t extent : shape) text += (text.size() > 1 ? ", " : "") + std::to_string(extent);
  return text + "]";
}

bool is_float(torch::ScalarType type) {
  return type == torch::kFloat32 || type == torch::kFloat16 || type == torch::kBFloat16;
}

// Returns the body's buffers in an official checkpoint, by their names there.
std::map<std::string, torch::Tensor> body_buffers(const smal::tensors::SmalAsset& asset) {
  return {{"smal.shapedirs", asset.shapedirs},     {"smal.v_template", asset.v_template},
          {"smal.posedirs", asset.posedirs},       {"smal.J_regressor", asset.j_regressor},
          {"smal.lbs_weights", asset.lbs_weights}, {"smal.faces", asset.faces},
          {"smal.parents", asset.parents}};
}

void check_entry(const std::string& name, const torch::Tensor& got, at::IntArrayRef expected,
                 std::vector<std::string>& faults) {
  if (got.sizes() != expected) {
    faults.push_back(
        fmt::format("{}: shape {}, expected {}", name, shape_text(got.sizes()), shape_text(expected)));
  }
}

// Returns every difference between the file and the network, one on each line.
std::vector<std::string> find_faults(const smal::tensors::SafeTensors& file, const PrimaNet& net,
                                     const smal::tensors::SmalAsset& asset) {
  std::vector<std::string> faults;
  const auto parameters = net.named_parameters();
  for (const auto& parameter : parameters) {
    if (!file.contains(parameter.key())) {
      faults.push_back(
          fmt::format("{}: missing, expected {}", parameter.key(), shape_text(parameter.value().sizes())));
      continue;
    }
    const torch::Tensor stored = file.tensor(parameter.key());
    check_entry(parameter.key(), stored, parameter.value().sizes(), faults);
    if (!is_float(stored.scalar_type())) {
      faults.push_back(fmt::format("{}: dtype {}, expected float32, float16 or bfloat16", parameter.key(),
                                   torch::toString(stored.scalar_type())));
    }
  }
  const auto buffers = body_buffers(asset);
  for (const std::string& name : file.names()) {
    if (parameters.contains(name)) continue;
    if (const auto buffer = buffers.find(name); buffer != buffers.end()) {
      check_entry(name, file.tensor(name), buffer->second.sizes(), faults);
    } else if (!is_allowed_extra(name)) {
      faults.push_back(name + ": not part of the network");
    }
  }
  return faults;
}

// Releases the file's pages from this process after their numbers were copied; the kernel's cache keeps them.
// Without this the mapping of a full-size file counts as a second copy of the weights.
void release_pages(const torch::Tensor& mapped) {
  const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto begin = reinterpret_cast<std::uintptr_t>(mapped.const_data_ptr());
  const std::uintptr_t first = (begin + page - 1) / page * page;
  const std::uintptr_t last = (begin + mapped.nbytes()) / page * page;
  if (first < last) ::madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
}

}  // namespace

std::vector<TensorSpec> expected_tensors(const PrimaConfig& config) {
  const PrimaNet net(config, {torch::kMeta, torch::kFloat32});
  std::vector<TensorSpec> specs;
  for (const auto& parameter : net.named_parameters()) {
    specs.push_back({parameter.key(), parameter.value().sizes().vec()});
  }
  return specs;
}

bool is_allowed_extra(const std::string& name) {
  static constexpr std::string_view kText = "bioclip_embedding.species_model.";
  static constexpr std::array<std::string_view, 7> kTextTower{
      "transformer.", "token_embedding.", "positional_embedding", "ln_final.", "text_projection",
      "logit_scale",  "attn_mask"};
  static constexpr std::array<std::string_view, 5> kOthers{"smal.", "discriminator.", "shape_prior_loss.",
                                                           "pose_prior_loss.", "training."};
  const std::string_view view(name);
  const auto starts = [](std::string_view text) {
    return [text](std::string_view prefix) { return text.substr(0, prefix.size()) == prefix; };
  };
  if (view == "initialized") return true;
  if (view.substr(0, kText.size()) == kText) {
    return std::any_of(kTextTower.begin(), kTextTower.end(), starts(view.substr(kText.size())));
  }
  return std::any_of(kOthers.begin(), kOthers.end(), starts(view));
}

PrimaConfig checkpoint_config(const smal::tensors::SafeTensors& file) {
  const auto entry = file.metadata().find(kConfigKey);
  if (entry == file.metadata().end()) {
    throw std::runtime_error(fmt::format(
        "{}: no '{}' in the metadata, so the network's sizes are unknown; import official weights "
        "with tools/import_assets.py",
        file.path().string(), kConfigKey));
  }
  try {
    return config_from_json(manifests::parse_json<nlohmann::json>(entry->second));
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: metadata '{}': {}", file.path().string(), kConfigKey, error.what()));
  }
}

std::shared_ptr<PrimaNet> load_net(const smal::tensors::SafeTensors& file, const PrimaConfig& config,
                                   const smal::tensors::SmalAsset& asset, const Placement& placement) {
  const at::NoGradGuard no_grad;
  const PrimaNet plan(config, {torch::kMeta, placement.matrix_dtype});
  if (const auto faults = find_faults(file, plan, asset); !faults.empty()) {
    std::string message =
        fmt::format("{}: {} faults keep it from fitting the network:", file.path().string(), faults.size());
    for (const std::string& fault : faults) message += "\n  " + fault;
    throw std::runtime_error(message);
  }
  auto net = std::make_shared<PrimaNet>(config, placement);
  for (auto& parameter : net->named_parameters()) {
    const torch::Tensor stored = file.tensor(parameter.key());
    // One number that is not finite makes every prediction NaN, and a build would then fail every candidate.
    if (!stored.isfinite().all().item<bool>()) {
      throw std::runtime_error(
          fmt::format("{}: {} holds NaN or infinity, expected finite numbers; take a checkpoint from before "
                      "the training diverged, or get the file again",
                      file.path().string(), parameter.key()));
    }
    parameter.value().copy_(stored);
    release_pages(stored);
  }
  return net;
}

void write_checkpoint(const std::filesystem::path& path, const PrimaConfig& config,
                      const smal::tensors::NamedTensors& tensors,
                      const std::map<std::string, std::string>& more_metadata) {
  std::map<std::string, std::string> metadata = more_metadata;
  metadata[kConfigKey] = to_json(config).dump();
  using smal::tensors::Sync;
  const Sync sync = manifests::durability().syncs ? Sync::yes : Sync::no;
  smal::tensors::write_safetensors(path, tensors, metadata, sync);
}

}  // namespace q3d::model
