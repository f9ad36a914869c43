#include "pipeline/training/training_state.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "model/checkpoint.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::training {
namespace {

constexpr const char* kPosition = "training_position";
constexpr const char* kKey = "training_key";

const std::string& entry(const smal::tensors::SafeTensors& file, const char* name) {
  const auto found = file.metadata().find(name);
  if (found != file.metadata().end()) return found->second;
  throw std::runtime_error(
      fmt::format("{}: no \"{}\" in the metadata: this is no training state", file.path().string(), name));
}

}  // namespace

void save_state(const std::filesystem::path& path, const model::Learner& learner,
                const TrainingPosition& position, const std::string& key) {
  // JSON keeps a double's shortest exact form, so the watch comes back bit for bit.
  const nlohmann::json document = {{"phase", position.phase},
                                   {"step", position.step},
                                   {"watch_mean", position.watch.mean},
                                   {"watch_seen", position.watch.seen}};
  model::write_checkpoint(path, learner.net().config(), learner.state(),
                          {{kPosition, document.dump()}, {kKey, key}});
}

std::optional<StoredState> load_state(const std::filesystem::path& path, const std::string& key) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  StoredState state{smal::tensors::SafeTensors::open(path), {}};
  if (entry(state.file, kKey) != key) {
    throw run::ConfigError(
        fmt::format("{}: this run was begun with another configuration, other pools or other assets; give "
                    "another --out, or remove the folder to begin again",
                    path.parent_path().string()));
  }
  try {
    const nlohmann::json document = nlohmann::json::parse(entry(state.file, kPosition));
    document.at("phase").get_to(state.position.phase);
    document.at("step").get_to(state.position.step);
    document.at("watch_mean").get_to(state.position.watch.mean);
    document.at("watch_seen").get_to(state.position.watch.seen);
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(fmt::format("{}: metadata \"{}\": {}", path.string(), kPosition, error.what()));
  }
  return state;
}

}  // namespace q3d::pipeline::training
