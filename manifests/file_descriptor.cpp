#include "manifests/file_descriptor.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>
#include <utility>

#include "manifests/durability.h"

namespace q3d::manifests {
namespace {

using namespace std::chrono_literals;

constexpr std::array<std::chrono::milliseconds, 3> kPauses{50ms, 200ms, 800ms};

int open_file(const std::filesystem::path& path, int flags) {
  for (int attempt = 0;;) {
    const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC, 0666);
    if (descriptor >= 0) return descriptor;
    if (errno != EINTR && !pause_before_retry(errno, attempt++)) return descriptor;
  }
}

}  // namespace

bool names_no_file(int code) {
  switch (code) {
    case ENOENT:
    case ENOTDIR:
    case EISDIR:
    case ELOOP:
    case ENAMETOOLONG:
    case ENXIO:  // a socket, or a device that is not there
      return true;
    default:
      return false;
  }
}

bool pause_before_retry(int code, int attempt) {
  const bool may_pass = code == EAGAIN || code == ESTALE;
  if (!may_pass || static_cast<std::size_t>(attempt) >= kPauses.size()) return false;
  std::this_thread::sleep_for(kPauses[static_cast<std::size_t>(attempt)]);
  errno = code;
  return true;
}

IoError::IoError(std::string_view doing, std::filesystem::path path, int code)
    : IoError(doing, std::move(path), std::generic_category().message(code), code) {}

IoError::IoError(std::string_view doing, std::filesystem::path path, std::string reason, int code)
    : std::runtime_error(fmt::format("cannot {} {}: {}", doing, path.string(), reason)),
      path_(std::move(path)),
      reason_(std::move(reason)),
      code_(code) {}

void throw_errno(std::string_view doing, const std::filesystem::path& path) {
  throw IoError(doing, path, errno);
}

FileDescriptor::FileDescriptor(const std::filesystem::path& path, int flags)
    : path_(path), descriptor_(open_file(path, flags)) {
  if (descriptor_ < 0) throw_errno((flags & O_CREAT) != 0 ? "create" : "open", path);
}

FileDescriptor::~FileDescriptor() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

FileDescriptor::FileDescriptor(FileDescriptor&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

FileDescriptor& FileDescriptor::operator=(FileDescriptor&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

std::uint64_t FileDescriptor::size() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) throw_errno("inspect", path_);
  return static_cast<std::uint64_t>(status.st_size);
}

void FileDescriptor::write_all(std::span<const std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      throw_errno("write", path_);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

void FileDescriptor::write_all(std::string_view text) const {
  write_all(std::as_bytes(std::span(text)));
}

void FileDescriptor::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  for (int attempt = 0; !bytes.empty();) {
    const ssize_t got = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (got < 0) {
      // A stale descriptor stays stale; read_input() opens the file again.
      const bool may_pass = errno == EINTR || (errno == EAGAIN && pause_before_retry(errno, attempt++));
      if (may_pass) continue;
      throw_errno("read", path_);
    }
    if (got == 0) {
      throw IoError("read", path_,
                    fmt::format("it ends {} bytes before byte {}", bytes.size(), offset + bytes.size()), 0);
    }
    offset += static_cast<std::uint64_t>(got);
    bytes = bytes.subspan(static_cast<std::size_t>(got));
  }
}

void FileDescriptor::sync() const {
  if (!durability().syncs) return;
  while (::fsync(descriptor_) != 0) {
    if (errno == EINTR) continue;
    const int code = errno;
    if (code != EINVAL && code != ENOTSUP && code != ENOSYS) throw_errno("sync", path_);
    throw IoError(
        "sync", path_,
        std::generic_category().message(code) +
            ". This file system cannot say when a file has reached the disk. Choose a folder on another "
            "one, or give --no-sync: then a power cut may lose finished work",
        code);
  }
}

void FileDescriptor::close() {
  if (::close(std::exchange(descriptor_, -1)) != 0) throw_errno("close", path_);
}

FileDescriptor open_input(const std::filesystem::path& path) {
  FileDescriptor file(path, O_RDONLY | O_NONBLOCK);
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) throw_errno("inspect", path);
  if (!S_ISREG(status.st_mode)) {
    throw IoError("read", path, "got a folder, pipe or device, expected a file", EISDIR);
  }
  return file;
}

std::vector<std::byte> read_bytes(const std::filesystem::path& path) {
  return read_input(path, [](const FileDescriptor& file) {
    std::vector<std::byte> bytes(file.size());
    file.read_at(0, bytes);
    return bytes;
  });
}

}  // namespace q3d::manifests
