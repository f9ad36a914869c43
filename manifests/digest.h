// SHA-256 digests of bytes and files, and a cache that spares reading unchanged files again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>

namespace q3d::manifests {

std::string sha256(std::span<const std::byte> bytes);  // 64 lower-case hex digits
std::string sha256(std::string_view text);
std::string sha256_file(const std::filesystem::path& path);  // throws std::runtime_error when unreadable

// Remembers file digests by path, size, mtime and inode. Thread-safe. `verify` never uses it.
class DigestCache {
 public:
  explicit DigestCache(
      std::filesystem::path file);  // loads the file if it is there; a damaged line is dropped
  std::string digest(const std::filesystem::path& path);  // throws std::runtime_error when unreadable
  void save() const;                                      // atomic; throws std::runtime_error

 private:
  struct Entry {
    std::uint64_t size = 0;
    std::int64_t mtime_ns = 0;
    std::uint64_t inode = 0;
    std::string sha256;
  };
  std::filesystem::path file_;
  mutable std::mutex mutex_;
  std::map<std::string, Entry> entries_;
};

}  // namespace q3d::manifests
