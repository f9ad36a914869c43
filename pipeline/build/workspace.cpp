#include "pipeline/build/workspace.h"

#include <fmt/format.h>

#include <cstdio>
#include <thread>

#include "pipeline/leakage/exclusions.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/network/torch_network.h"

namespace q3d::pipeline::build {
namespace {

std::size_t flow_threads(int wanted) {
  if (wanted > 0) return static_cast<std::size_t>(wanted);
  return std::max<std::size_t>(1, std::thread::hardware_concurrency());
}

std::filesystem::path made(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw std::runtime_error(
        fmt::format("{}: cannot make the output folder: {}", folder.string(), error.message()));
  }
  return folder;
}

}  // namespace

Workspace::Workspace(const config::BuildConfig& config, const run::RunOptions& options)
    : config_(config),
      options_(options),
      threads_(tbb::global_control::max_allowed_parallelism, flow_threads(options.threads)),
      lock_(made(options.out)),
      digests_(options.out / "digests.txt"),
      assets_(stages::digest_assets(config, digests_)),
      device_key_(config::needs_network(config) ? network::device_key(config.network) : std::string()),
      ingest_(candidates::ingest(config, digests_, network::load_body_meshes)) {
  if (!options_.warn) options_.warn = [](const std::string&) {};
  leakage::leave_out(config, digests_, options.out, options.quiet, ingest_);
  if (options_.quiet) return;
  fmt::print(stderr, "{} candidates in {} units\n", ingest_.candidates.size(), ingest_.units.size());
  for (const std::string& note : ingest_.notes) fmt::print(stderr, "note: {}\n", note);
}

device::Network& Workspace::network() {
  if (!network_) {
    network_ = network::load_network(config_.network, config_.tta);
    if (!network_->device_warning().empty()) fmt::print(stderr, "warning: {}\n", network_->device_warning());
    if (!options_.quiet) fmt::print(stderr, "network on {}\n", network_->device_description());
  }
  return *network_;
}

}  // namespace q3d::pipeline::build
