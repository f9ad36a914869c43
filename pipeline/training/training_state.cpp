#include "pipeline/training/training_state.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstddef>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string_view>

#include "manifests/digest.h"
#include "manifests/json_number.h"
#include "manifests/json_parse.h"
#include "model/checkpoint.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/log.h"
#include "smal/tensors/safetensors_header.h"

namespace q3d::pipeline::training {
namespace {

constexpr const char* kPosition = "training_position";
constexpr const char* kKey = "training_key";
constexpr const char* kDigest = "training_sha256";

// Returns a digest of the state's tensors and of the text that describes them. The order in the file does not
// matter.
std::string state_digest(const std::map<std::string, torch::Tensor>& tensors, const std::string& position,
                         const std::string& key) {
  manifests::Sha256 digest;
  const auto add = [&](std::string_view text) { digest.update(std::as_bytes(std::span(text))); };
  add(fmt::format("{}\n{}\n", key, position));
  for (const auto& [name, tensor] : tensors) {
    add(fmt::format("{} {} [{}]\n", name, smal::tensors::dtype_name(tensor.scalar_type()),
                    fmt::join(tensor.sizes(), ", ")));
    digest.update({static_cast<const std::byte*>(tensor.data_ptr()), tensor.nbytes()});
  }
  return digest.hex();
}

const std::string& entry(const smal::tensors::SafeTensors& file, const char* name) {
  const auto found = file.metadata().find(name);
  if (found != file.metadata().end()) return found->second;
  throw std::runtime_error(
      fmt::format("{}: no \"{}\" in the metadata: this is no training state", file.path().string(), name));
}

// Throws std::runtime_error if the file's numbers are not those that were written.
void require_undamaged(const smal::tensors::SafeTensors& file) {
  if (!file.metadata().contains(kDigest)) {
    run::log_warning(
        fmt::format("{}: an earlier version of this program wrote this state without a digest, so "
                    "damage in it cannot be seen",
                    file.path().string()));
    return;
  }
  std::map<std::string, torch::Tensor> tensors;
  for (const std::string& name : file.names()) tensors[name] = file.tensor(name);
  const std::string got = state_digest(tensors, entry(file, kPosition), entry(file, kKey));
  const std::string& expected = entry(file, kDigest);
  if (got == expected) return;
  throw std::runtime_error(fmt::format(
      "{}: damaged: got the SHA-256 {}, expected {}; take the file from a copy, or remove it to begin "
      "the run again",
      file.path().string(), got, expected));
}

}  // namespace

void save_state(const std::filesystem::path& path, const model::Learner& learner,
                const TrainingPosition& position, const std::string& key) {
  // JSON keeps a double's shortest exact form, so the watch is restored bit for bit.
  const nlohmann::json document = {{"phase", position.phase},
                                   {"step", position.step},
                                   {"watch_mean", position.watch.mean},
                                   {"watch_seen", position.watch.seen}};
  smal::tensors::NamedTensors state = learner.state();
  std::map<std::string, torch::Tensor> by_name;
  for (auto& [name, tensor] : state) {
    tensor = tensor.detach().to(torch::kCPU).contiguous();
    by_name[name] = tensor;
  }
  const std::string text = document.dump();
  model::write_checkpoint(path, learner.net().config(), state,
                          {{kPosition, text}, {kKey, key}, {kDigest, state_digest(by_name, text, key)}});
}

std::optional<StoredState> load_state(const std::filesystem::path& path, const std::string& key) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  StoredState state{smal::tensors::SafeTensors::open(path), {}};
  require_undamaged(state.file);
  if (entry(state.file, kKey) != key) {
    throw run::ConfigError(
        fmt::format("{}: this run was begun with another configuration, other pools or other assets; give "
                    "another --out, or remove the folder to begin again",
                    path.parent_path().string()));
  }
  try {
    const nlohmann::json document = manifests::parse_json<nlohmann::json>(entry(state.file, kPosition));
    constexpr int kMost = std::numeric_limits<int>::max();
    state.position.phase = static_cast<int>(manifests::whole_number_at(document, "phase", 0, kMost));
    state.position.step = manifests::whole_number_at(document, "step");
    document.at("watch_mean").get_to(state.position.watch.mean);
    state.position.watch.seen = manifests::whole_number_at(document, "watch_seen");
  } catch (const std::exception& error) {  // from the JSON library or from whole_number()
    throw std::runtime_error(fmt::format("{}: metadata \"{}\": {}", path.string(), kPosition, error.what()));
  }
  return state;
}

}  // namespace q3d::pipeline::training
