// Every run over an output folder begins with a workspace: the lock, the candidates, the assets and the
// network.
#pragma once

#include <tbb/global_control.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/digest.h"
#include "manifests/lock.h"
#include "pipeline/build/quality.h"
#include "pipeline/build/scratch_copy.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/device/device_worker.h"
#include "pipeline/device/network.h"
#include "pipeline/run/run_options.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::build {

// Returns how many threads RunOptions::threads asks for: 0 means one for each core.
std::size_t flow_threads(int wanted);

// Logs the number of candidates and units, unless `quiet`. Every run does this.
void log_candidates(std::int64_t candidates, std::int64_t units, bool quiet);
void log_notes(const std::vector<candidates::IngestNote>& notes, bool quiet);

class Workspace {
 public:
  enum class Use : std::uint8_t {
    work,  // makes the output folder, holds its lock, and keeps digests and findings in it
    look,  // writes nothing into it; digests and findings go to a scratch folder until the end
    join,  // writes units' files into it, beside a process of Use::work, which keeps the lock and the
           // digests and reports
  };

  // Takes the folder's lock, digests the assets and ingests the datasets. Throws ConfigError,
  // std::runtime_error, Interrupted.
  Workspace(const config::BuildConfig& config, const run::RunOptions& options, Use use = Use::work);

  // These functions may be called for Use::work and Use::join.
  const std::filesystem::path& out() const { return options_.out; }
  // The folder for files that are needed only until this process ends.
  const std::filesystem::path& scratch() const { return scratch_ ? scratch_->folder() : options_.out; }
  const candidates::Ingest& ingest() const { return ingest_; }
  const stages::AssetDigests& assets() const { return assets_; }
  // Returns the origins of network and body; empty if no dataset needs the network.
  const Origins& origins() const { return origins_; }
  // It is empty, like the digests of assets(), if no dataset needs the network.
  const std::string& device_key() const { return device_key_; }
  bool quiet() const { return options_.quiet; }
  bool rebuilds() const { return options_.rebuild; }
  bool above_ceiling() const { return options_.above_ceiling; }
  manifests::DigestCache& digests() { return digests_; }

  // Returns the thread on which the network runs.
  device::DeviceWorker& device() { return device_; }
  // Returns the network, which is loaded at the first call. Call it on device()'s thread only.
  device::Network& network();

 private:
  const config::BuildConfig& config_;
  run::RunOptions options_;
  tbb::global_control threads_;
  std::optional<manifests::FolderLock> lock_;
  std::optional<ScratchCopy> scratch_;  // used by Use::look
  manifests::DigestCache digests_;
  stages::AssetDigests assets_;
  std::string device_key_;
  Origins origins_;
  candidates::Ingest ingest_;
  std::unique_ptr<device::Network> network_;
  device::DeviceWorker device_;
};

}  // namespace q3d::pipeline::build
