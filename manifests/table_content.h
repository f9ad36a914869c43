// The bytes of a table, which lie in a file on disk or in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "manifests/reopened_file.h"

namespace q3d::manifests {

class TableContent {
 public:
  // Opens a file; the bytes stay on disk. Throws IoError.
  explicit TableContent(const std::filesystem::path& path);
  // Takes the bytes of a file that was read already; `path` names it in messages.
  TableContent(std::filesystem::path path, std::vector<std::byte> bytes);

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const;
  // Fills `bytes` from `offset` on. Safe from many threads at once. Throws as ReopenedFile::read_at does, and
  // IoError if the bytes in memory end before.
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  // The bytes that are in memory; nothing when they are on disk.
  std::optional<std::span<const std::byte>> in_memory() const;

 private:
  std::filesystem::path path_;
  std::unique_ptr<ReopenedFile> file_;  // null if the bytes are in memory
  std::vector<std::byte> bytes_;
};

}  // namespace q3d::manifests
