// Implements the network with LibTorch.
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

// A checkpoint below this size belongs to a small network, whose operators are too short to split between
// threads.
inline constexpr std::uintmax_t kSmallCheckpointBytes = std::uintmax_t{64} << 20U;

// Returns the number of threads of one CPU operator: the config's number or, if that is 0, all cores for a
// large network and one for a small network. The results of a small network then do not depend on the number
// of cores. Throws std::filesystem::filesystem_error when the checkpoint is missing.
int compute_threads(const config::NetworkConfig& network);

// Names the properties of device, threads and LibTorch that decide the result's bits: "cpu-2, intel avx512,
// kernels AVX512, LibTorch 2.11.0" or "cuda, NVIDIA H200, LibTorch 2.11.0". It is part of the stage keys.
// Loads nothing. Throws as load_network does.
std::string device_key(const config::NetworkConfig& network);

// Returns the checkpoint's statement about the pictures that its network knows, or `unknown` if there is
// none. Throws std::runtime_error naming the file.
device::NetworkDomain read_domain(const std::filesystem::path& checkpoint);

// Writes a seeded checkpoint of a named size ("vith", "small", "lite", "tiny"), with the weights of the
// pre-trained stem in the file `stem` unless that is empty. Throws ConfigError for another name, or a stem
// for a size that has none, std::runtime_error when a file cannot be read or written.
void write_initial_checkpoint(const std::filesystem::path& path, const std::string& size, std::uint64_t seed,
                              const std::filesystem::path& stem = {});

}  // namespace q3d::pipeline::network
