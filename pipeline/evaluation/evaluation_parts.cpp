#include "pipeline/evaluation/evaluation_parts.h"

#include <nlohmann/json.hpp>

#include "manifests/atomic_file.h"
#include "pipeline/config/build_settings.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kCode = 1;  // raise it when a change of the code changes a result

std::optional<manifests::FolderLock> locked(const fs::path& folder, bool leads) {
  if (!leads) return std::nullopt;
  fs::create_directories(folder);
  return std::optional<manifests::FolderLock>(std::in_place, folder);
}

}  // namespace

EvaluationParts::EvaluationParts(const fs::path& out, bool leads)
    : folder_(folder_in(out)), lock_(locked(folder_, leads)), digests_(folder_ / "digests.txt") {
  if (!leads) return;
  manifests::remove_temporaries(out);
  manifests::remove_temporaries(folder_);
}

void EvaluationParts::remove() {
  lock_.reset();
  fs::remove_all(folder_);
  manifests::sync_folder(folder_.parent_path());
}

std::string key_of_results(const EvaluationConfig& config, const Plan& plan, const Evaluation& evaluation) {
  json parts = config::key_parts(config::network_settings(), config.network, config::DecidedStage::predict);
  parts["code"] = kCode;
  parts["checkpoint"] = evaluation.checkpoint_sha256;
  parts["smal_asset"] = evaluation.smal_asset_sha256;
  parts["device"] = evaluation.device_key;
  parts["tta"] = config::key_parts(config::tta_settings(), config.tta, config::DecidedStage::refine);
  if (config::uses_priors(config.tta)) parts["priors"] = manifests::sha256_file(config.priors);
  parts["seed"] = evaluation.options.seed;
  parts["passes"] = json::array();
  for (const TtaPass& pass : plan.passes) {
    parts["passes"].push_back({{"iterations", pass.iterations},
                               {"visible_share", pass.visible_share},
                               {"iterates", pass.iterates}});
  }
  return manifests::sha256(parts.dump());
}

}  // namespace q3d::pipeline::evaluation
