// The stages of a build by name, in the order in which a unit goes through them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace q3d::pipeline::stages {

struct StageKeys;

enum class Stage : std::uint8_t { ingest, predict, fidelity, refine, measure, crops, shards };

inline constexpr std::array<Stage, 7> kStages{Stage::ingest,  Stage::predict, Stage::fidelity, Stage::refine,
                                              Stage::measure, Stage::crops,   Stage::shards};

std::string_view to_string(Stage stage);
Stage stage_from_string(std::string_view name);   // throws std::invalid_argument on an unknown name
std::span<const std::string_view> stage_names();  // in the order of the enumerators

// Returns whether the stage has a folder with a file for each unit. `ingest` has the build's plan
// (build_plan.h) instead, and every build computes the results of `fidelity` again.
constexpr bool has_folder(Stage stage) {
  return stage != Stage::ingest && stage != Stage::fidelity;
}

// Returns whether a unit's file depends on exclusions and on the datasets' terms, in addition to the unit's
// input.
constexpr bool depends_on_labels(Stage stage) {
  return stage == Stage::measure || stage == Stage::shards;
}

// Returns the key of a stage. It is empty for `measure` in a build without pseudo labels, and if dataset.json
// does not state it.
const std::string& key_of(const StageKeys& keys, Stage stage);
std::string& key_of(StageKeys& keys, Stage stage);

}  // namespace q3d::pipeline::stages
