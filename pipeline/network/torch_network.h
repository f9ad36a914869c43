// The network on LibTorch.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "pipeline/config/build_config.h"
#include "pipeline/device/domain.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::network {

// Loads checkpoint and SMAL asset, and the file of priors if adaptation's objective has a term of them.
// Throws std::runtime_error (weights, asset, priors, device) or ConfigError (device name).
std::unique_ptr<device::Network> load_network(const config::NetworkConfig& network,
                                              const config::TtaConfig& tta,
                                              const std::filesystem::path& priors);

// A checkpoint below this size is that of a small network: its operators are too short to share.
inline constexpr std::uintmax_t kSmallCheckpointBytes = std::uintmax_t{64} << 20U;

// Threads of one CPU operator: the config's number, or, where that is 0, all cores for a large network and
// one for a small one. A small network's results then do not depend on the number of cores either. Throws
// std::filesystem::filesystem_error when the checkpoint is missing.
int compute_threads(const config::NetworkConfig& network);

// Names what of device, threads and LibTorch decides the result's bits: "cpu-2, intel avx512, kernels AVX512,
// LibTorch 2.11.0" or "cuda, NVIDIA H200, LibTorch 2.11.0". It is part of the stage keys. Loads nothing.
// Throws as load_network does.
std::string device_key(const config::NetworkConfig& network);

// Returns what the checkpoint says of the pictures that its network knows, or `unknown` if it says nothing.
// Throws std::runtime_error naming the file.
device::NetworkDomain read_domain(const std::filesystem::path& checkpoint);

// A seeded checkpoint of a named size ("vith", "small", "lite", "tiny"), with the weights of the pre-trained
// stem in the file `stem` unless that is empty. Throws ConfigError for another name, or a stem for a size
// that has none, std::runtime_error when a file cannot be read or written.
void write_initial_checkpoint(const std::filesystem::path& path, const std::string& size, std::uint64_t seed,
                              const std::filesystem::path& stem = {});

}  // namespace q3d::pipeline::network
