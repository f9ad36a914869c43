#include "pipeline/stages/stage.h"

#include "manifests/enum_names.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {
namespace {

constexpr manifests::EnumNames kNames("stage", Stage::ingest, Stage::shards,
                                      {"ingest", "predict", "fidelity", "refine", "measure", "crops",
                                       "shards"});
constexpr std::array<std::string StageKeys::*, 7> kKeys{
    &StageKeys::ingest,  &StageKeys::predict, &StageKeys::fidelity, &StageKeys::refine,
    &StageKeys::measure, &StageKeys::crops,   &StageKeys::shards};

}  // namespace

std::string_view to_string(Stage stage) {
  return kNames.name(stage);
}

Stage stage_from_string(std::string_view name) {
  return kNames.value(name);
}

std::span<const std::string_view> stage_names() {
  return kNames.all();
}

const std::string& key_of(const StageKeys& keys, Stage stage) {
  return keys.*kKeys.at(static_cast<std::size_t>(stage));
}

std::string& key_of(StageKeys& keys, Stage stage) {
  return keys.*kKeys.at(static_cast<std::size_t>(stage));
}

}  // namespace q3d::pipeline::stages
