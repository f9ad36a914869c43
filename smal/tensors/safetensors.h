// Reads safetensors files through a memory mapping and writes them atomically.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace q3d::smal::tensors {

// A read-only mapping. Tensors share the mapped pages and keep the mapping alive.
class SafeTensors {
 public:
  // Throws std::runtime_error that names path and entry, what was found and what was expected, if the file is
  // not a safetensors file or is truncated, if offsets overlap, leave holes or point outside, for an unknown
  // dtype, and for a shape that disagrees with the byte count.
  static SafeTensors open(const std::filesystem::path& path);

  const std::filesystem::path& path() const;
  const std::map<std::string, std::string>& metadata() const;
  std::vector<std::string> names() const;  // sorted
  bool contains(const std::string& name) const;
  // Returns a CPU tensor over the mapping; do not write to it. Throws std::runtime_error if the name is
  // absent.
  torch::Tensor tensor(const std::string& name) const;

 private:
  struct Mapping;
  std::shared_ptr<const Mapping> mapping_;
};

using NamedTensors = std::vector<std::pair<std::string, torch::Tensor>>;

enum class Sync { yes, no };  // whether a file is made durable; some network disks cannot do it

// Writes under a temporary name, fsyncs and renames. Tensors are written contiguous, in the given order.
// Throws std::runtime_error naming the path and the system's reason.
void write_safetensors(const std::filesystem::path& path, const NamedTensors& tensors,
                       const std::map<std::string, std::string>& metadata = {}, Sync sync = Sync::yes);

}  // namespace q3d::smal::tensors
