// A POSIX file descriptor that closes itself. Reads and writes are complete or throw.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace q3d::manifests {

// Throws std::runtime_error "cannot <doing> <path>: <reason of errno>".
[[noreturn]] void throw_errno(std::string_view doing, const std::filesystem::path& path);

class FileDescriptor {
 public:
  FileDescriptor() = default;
  // Calls open(2) with O_CLOEXEC. A new file gets mode 0666 less the umask. Throws std::runtime_error.
  FileDescriptor(const std::filesystem::path& path, int flags);
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept;
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;

  int get() const { return descriptor_; }
  const std::filesystem::path& path() const { return path_; }

  std::uint64_t size() const;
  void write_all(std::span<const std::byte> bytes) const;
  void write_all(std::string_view text) const;
  // Fills `bytes` with the file's content from `offset` on. It does not move the file position, so many
  // threads may call it at once.
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  void sync() const;
  // Closes the file. Network file systems report a failed write only here, so whoever wrote must call it.
  void close();

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

}  // namespace q3d::manifests
