// SHA-256 digests of bytes and files, and a cache that avoids reading unchanged files again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "manifests/path_table.h"

struct evp_md_ctx_st;  // OpenSSL's EVP_MD_CTX

namespace q3d::manifests {

std::string sha256(std::span<const std::byte> bytes);  // 64 lower-case hex digits
std::string sha256(std::string_view text);
// A digest as bytes, which take half the space of its hex digits.
using DigestBytes = std::array<std::uint8_t, 32>;
std::string to_hex(const DigestBytes& digest);
std::optional<DigestBytes> digest_from_hex(std::string_view hex);  // nothing unless it is 64 hex digits

// Reads the file in blocks. Throws IoError (manifests/file_descriptor.h) when it cannot be read.
std::string sha256_file(const std::filesystem::path& path);

// Computes the SHA-256 of bytes that come in pieces.
class Sha256 {
 public:
  Sha256();
  void update(std::span<const std::byte> bytes);
  std::string hex();  // 64 lower-case hex digits; call once, at the end

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

// Remembers the digests of files by path, size, mtime and inode. Thread-safe. `verify` never uses it.
//
// The cache does not remember a file that was modified less than two seconds before it was digested. A later
// write within the same tick of the file system's clock could leave size and mtime unchanged.
class DigestCache {
 public:
  // Loads the file if it exists; damaged lines are dropped. Throws std::runtime_error if the file is
  // unreadable.
  explicit DigestCache(std::filesystem::path file);
  std::string digest(const std::filesystem::path& path);  // throws IoError when it cannot be read
  // Returns nothing if there is no such file. Throws IoError if there is one that cannot be read, which says
  // nothing about its content.
  std::optional<std::string> digest_if_present(const std::filesystem::path& path);
  // Writes one checked line for each entry, sorted by path, atomically, unless the file holds them already.
  // Throws std::runtime_error.
  void save() const;

 private:
  struct Entry {
    std::uint64_t size = 0;
    std::int64_t mtime_ns = 0;
    std::uint64_t inode = 0;  // 0: no digest is remembered for this path
    DigestBytes sha256{};
  };
  void remember(std::string_view path, const Entry& entry);

  std::filesystem::path file_;
  mutable std::mutex mutex_;  // guards the members below
  PathTable paths_;
  std::deque<Entry> entries_;      // indexed by the path's number in paths_
  mutable bool is_saved_ = false;  // true if the file holds exactly these entries
};

}  // namespace q3d::manifests
