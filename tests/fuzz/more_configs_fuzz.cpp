// The other configs: t of a training, e of an evaluation, c of `curate`, p of `predict` with photographs; and
// s a single setting of the command line.
#include <nlohmann/json.hpp>

#include "pipeline/config/config_override.h"
#include "pipeline/curation/curation_config.h"
#include "pipeline/evaluation/evaluation_config.h"
#include "pipeline/prediction/photographs_config.h"
#include "pipeline/run/errors.h"
#include "pipeline/training/settings/training_config.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
using q3d::pipeline::run::ConfigError;
namespace settings = q3d::pipeline::training::settings;

void read_training(const std::filesystem::path& file) {
  for (const char* stage : {"1", "3"}) {
    q3d::fuzz::value_or_refusal<ConfigError>(file, [&] {
      const settings::TrainingConfig config = settings::load_training_config({file}, stage);
      require(!config.phases.empty() && config.log_every > 0 && config.checkpoint_every > 0,
              "an accepted config can be trained");
      for (const auto& phase : config.phases) require(phase.steps > 0, "a phase has steps", phase.name);
      require(!deciding_values(config).dump().empty(), "an accepted config can be recorded");
    });
  }
}

void read_evaluation(const std::filesystem::path& file) {
  q3d::fuzz::value_or_refusal<ConfigError>(file, [&] {
    const auto config = q3d::pipeline::evaluation::load_evaluation_config({file}, {});
    require(!config.datasets.empty(), "an accepted config has datasets");
    require(!config.as_written.dump().empty(), "an accepted config can be recorded");
  });
}

void read_curation(const std::filesystem::path& file) {
  q3d::fuzz::value_or_refusal<ConfigError>(file, [&] {
    const auto config = q3d::pipeline::curation::load_curation_config({file});
    require(!config.datasets.empty() && config.name.find('/') == std::string::npos,
            "a list has a plain name");
  });
}

void read_photographs(const std::filesystem::path& file) {
  q3d::fuzz::value_or_refusal<ConfigError>(file, [&] {
    const auto config = q3d::pipeline::prediction::photographs_config(file.parent_path(), {}, {file});
    require(config.datasets.size() == 1, "the photographs are the only dataset");
  });
}

void read_setting(const std::string& text) {
  nlohmann::json resolved = {{"tta", {{"delta", 0.05}}}, {"datasets", {{{"name", "walk"}}}}};
  nlohmann::json as_written = resolved;
  try {
    const auto given = q3d::pipeline::config::parse_override(text);
    apply_override(
        given, [](nlohmann::json&, const std::filesystem::path&) {}, "/", resolved, as_written);
    require(!given.keys.empty() && resolved == as_written, "both layers get the setting", text);
  } catch (const ConfigError& error) {
    require(std::string_view(error.what()).find("--set") != std::string_view::npos, "a refusal says of what",
            error.what());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  const auto [reader, bytes] = q3d::fuzz::chosen_reader(data, size);
  const auto file = scratch.write("config.json", bytes);
  if (reader == 't') read_training(file);
  if (reader == 'e') read_evaluation(file);
  if (reader == 'c') read_curation(file);
  if (reader == 'p') read_photographs(file);
  if (reader == 's') read_setting(std::string(bytes));
  return 0;
}
