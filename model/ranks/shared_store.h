// A store of short texts that all ranks of a run can read and write, on any machine.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "model/ranks/rank_place.h"

namespace q3d::model::ranks {

// Says that the store does not answer, because the process that holds it has ended or cannot be reached.
class StoreLost : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Thread-safe. Every function throws StoreLost.
class SharedStore {
 public:
  SharedStore() = default;
  SharedStore(const SharedStore&) = delete;
  SharedStore& operator=(const SharedStore&) = delete;
  virtual ~SharedStore() = default;

  // Adds to a counter, which starts at 0, and returns its new value. Two ranks never get the same value of a
  // counter that only grows.
  virtual std::int64_t add(const std::string& key, std::int64_t value) = 0;
  virtual void set(const std::string& key, const std::string& value) = 0;
  // Returns nothing if no rank has set the key.
  virtual std::optional<std::string> get(const std::string& key) = 0;
  // Returns all values in one exchange. All keys must have been set.
  virtual std::vector<std::string> get_all(const std::vector<std::string>& keys) = 0;
};

// c10d's TCPStore. Torchrun's agent holds it, else rank 0 does. Ranks need not come at the same time: rank 0
// waits for nobody, and the others wait for the store up to place.join_timeout. Keys begin with `purpose`.
// Throws std::runtime_error when the store cannot be reached.
std::unique_ptr<SharedStore> open_shared_store(const RankPlace& place, const std::string& purpose);

}  // namespace q3d::model::ranks
