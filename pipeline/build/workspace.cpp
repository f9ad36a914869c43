#include "pipeline/build/workspace.h"

#include <fmt/format.h>

#include <thread>

#include "manifests/atomic_file.h"
#include "pipeline/leakage/exclusions.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/log.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::build {
namespace {

std::filesystem::path made(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw std::runtime_error(
        fmt::format("{}: cannot make the output folder: {}", folder.string(), error.message()));
  }
  return folder;
}

std::optional<manifests::FolderLock> locked(const std::filesystem::path& folder, Workspace::Use use) {
  if (use != Workspace::Use::work) return std::nullopt;
  return std::optional<manifests::FolderLock>(std::in_place, made(folder));
}

Origins read_origins(const config::BuildConfig& config) {
  if (!config::needs_network(config)) return {};
  return {network::read_domain(config.network.checkpoint),
          network::is_synthetic_body(config.network.smal_asset)};
}

}  // namespace

std::size_t flow_threads(int wanted) {
  if (wanted > 0) return static_cast<std::size_t>(wanted);
  return std::max<std::size_t>(1, std::thread::hardware_concurrency());
}

void log_candidates(std::int64_t candidates, std::int64_t units, bool quiet) {
  if (quiet) return;
  run::log_info(fmt::format("{} in {}", run::counted(candidates, "candidate"), run::counted(units, "unit")));
}

void log_notes(const std::vector<candidates::IngestNote>& notes, bool quiet) {
  for (const candidates::IngestNote& note : notes) {
    const bool is_caution = note.kind == loaders::formats::NoteKind::caution;
    if (is_caution || !quiet) run::log_note(note.line());
  }
}

Workspace::Workspace(const config::BuildConfig& config, const run::RunOptions& options, Use use)
    : config_(config),
      options_(options),
      threads_(tbb::global_control::max_allowed_parallelism, flow_threads(options.threads)),
      lock_(locked(options.out, use)),
      scratch_(use != Use::work ? std::optional<ScratchCopy>(std::in_place, options.out) : std::nullopt),
      digests_(scratch() / "digests.txt"),
      assets_(stages::digest_assets(config, digests_)),
      device_key_(config::needs_network(config) ? network::device_key(config.network) : std::string()),
      origins_(read_origins(config)),
      ingest_(candidates::ingest(config, digests_, network::load_body_meshes, scratch())) {
  if (!scratch_) manifests::remove_temporaries(options.out);  // of a killed run
  leakage::leave_out(config, digests_, scratch(), options.quiet, ingest_);
  log_candidates(static_cast<std::int64_t>(ingest_.candidates.size()),
                 static_cast<std::int64_t>(ingest_.units.size()), options_.quiet);
  if (use != Use::join) log_notes(ingest_.notes, options_.quiet);
  if (!options_.quiet && config::needs_network(config) &&
      origins_.domain.pictures == device::Pictures::unknown) {
    run::log_note(
        fmt::format("{} does not say which pictures its network knows, so nothing can be said about whether "
                    "these are like them",
                    config.network.checkpoint.filename().string()));
  }
}

device::Network& Workspace::network() {
  if (!network_) {
    network_ = network::load_network(config_.network, config_.tta, config::priors_file(config_));
    if (!network_->device_warning().empty()) run::log_warning(network_->device_warning());
    if (!options_.quiet) run::log_info("network on " + network_->device_description());
  }
  return *network_;
}

}  // namespace q3d::pipeline::build
