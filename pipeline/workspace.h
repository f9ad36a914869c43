// What every run over an output folder begins with: the lock, the candidates, the assets and the network.
#pragma once

#include <tbb/global_control.h>

#include <filesystem>
#include <memory>
#include <string>

#include "manifests/digest.h"
#include "manifests/lock.h"
#include "pipeline/build.h"
#include "pipeline/device_worker.h"
#include "pipeline/ingest.h"
#include "pipeline/network.h"
#include "pipeline/stages.h"

namespace q3d::pipeline {

class Workspace {
 public:
  // Takes the folder's lock, digests the assets and ingests the datasets. Throws ConfigError,
  // std::runtime_error, Interrupted.
  Workspace(const BuildConfig& config, const RunOptions& options);

  const std::filesystem::path& out() const { return options_.out; }
  const Ingest& ingest() const { return ingest_; }
  const AssetDigests& assets() const { return assets_; }
  // Empty, like the digests of assets(), when no dataset needs the network.
  const std::string& device_key() const { return device_key_; }
  bool quiet() const { return options_.quiet; }

  // The thread on which the network lives.
  DeviceWorker& device() { return device_; }
  // Loaded at the first call; call it on device()'s thread only.
  Network& network();

 private:
  const BuildConfig& config_;
  RunOptions options_;
  tbb::global_control threads_;
  manifests::FolderLock lock_;
  manifests::DigestCache digests_;
  AssetDigests assets_;
  std::string device_key_;
  Ingest ingest_;
  std::unique_ptr<Network> network_;
  DeviceWorker device_;
};

}  // namespace q3d::pipeline
