// c10d's store, for the sources of this room alone.
#pragma once

#include <fmt/format.h>

#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>

#include <cstdint>
#include <exception>
#include <string>

#include "model/ranks/rank_place.h"

namespace q3d::model::ranks {

enum class Gathering : std::uint8_t {
  together,  // rank 0 waits until all ranks have come
  loose,     // a rank comes when it comes
};

inline c10::intrusive_ptr<c10d::Store> open_tcp_store(const RankPlace& place, const std::string& purpose,
                                                      Gathering gathering) {
  c10d::TCPStoreOptions options;
  options.port = place.master_port;
  options.isServer = place.rank == 0 && !place.launcher_has_store;
  options.numWorkers = static_cast<std::size_t>(place.size);
  options.waitWorkers = gathering == Gathering::together;
  options.timeout = place.join_timeout;
  if (place.store_socket >= 0) options.masterListenFd = place.store_socket;
  // Torchrun keeps keys of its own in the store, and keeps the store when it starts the ranks again.
  return c10::make_intrusive<c10d::PrefixStore>(
      fmt::format("quadruped3d/{}/{}", purpose, place.attempt),
      c10::make_intrusive<c10d::TCPStore>(place.master_address, options));
}

inline std::string first_line(const std::exception& error) {
  const auto* torch_error = dynamic_cast<const c10::Error*>(&error);
  const std::string text = torch_error != nullptr ? torch_error->what_without_backtrace() : error.what();
  return text.substr(0, text.find('\n'));
}

}  // namespace q3d::model::ranks
