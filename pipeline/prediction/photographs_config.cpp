#include "pipeline/prediction/photographs_config.h"

namespace q3d::pipeline::prediction {

namespace fs = std::filesystem;

config::BuildConfig photographs_config(const fs::path& folder, const PhotographOptions& options,
                                       const std::vector<fs::path>& files,
                                       std::vector<std::string> settings) {
  nlohmann::json dataset{{"name", "photos"},
                         {"format", "photographs"},
                         {"root", fs::absolute(folder).string()},
                         {"annotations", "."},
                         {"min_confidence", options.min_score}};
  if (!options.boxes.empty()) dataset["annotations"] = fs::absolute(options.boxes).string();
  if (!options.species.empty()) dataset["species"] = options.species;
  // This replaces the config's own datasets, and their thresholds are dropped because they have no meaning
  // here.
  settings.push_back("datasets=" + nlohmann::json::array({dataset}).dump());
  settings.emplace_back("filter=null");
  return config::load_build_config(files, settings);
}

}  // namespace q3d::pipeline::prediction
