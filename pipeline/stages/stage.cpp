#include "pipeline/stages/stage.h"

#include "manifests/enum_names.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {
namespace {

constexpr std::array<std::string_view, 7> kNames{"ingest",  "predict", "fidelity", "refine",
                                                 "measure", "crops",   "shards"};
static_assert(kNames.size() == kStages.size());
constexpr std::array<std::string StageKeys::*, 7> kKeys{
    &StageKeys::ingest,  &StageKeys::predict, &StageKeys::fidelity, &StageKeys::refine,
    &StageKeys::measure, &StageKeys::crops,   &StageKeys::shards};

}  // namespace

std::string_view to_string(Stage stage) {
  return kNames.at(static_cast<std::size_t>(stage));
}

Stage stage_from_string(std::string_view name) {
  return manifests::enum_from_name<Stage>("stage", name, kNames);
}

std::span<const std::string_view> stage_names() {
  return kNames;
}

const std::string& key_of(const StageKeys& keys, Stage stage) {
  return keys.*kKeys.at(static_cast<std::size_t>(stage));
}

std::string& key_of(StageKeys& keys, Stage stage) {
  return keys.*kKeys.at(static_cast<std::size_t>(stage));
}

}  // namespace q3d::pipeline::stages
