// A POSIX file descriptor that closes itself. Reads and writes are complete or throw.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::manifests {

// True for an errno that means that there is no regular file of this name (ENOENT, ENOTDIR, EISDIR, ...).
// Every other errno (EIO, ESTALE, EMFILE, EACCES, ...) says nothing about the file's content.
bool names_no_file(int code);

// Says that the system refused an operation on a file. what() is "cannot <doing> <path>: <reason>".
class IoError : public std::runtime_error {
 public:
  IoError(std::string_view doing, std::filesystem::path path, int code);  // the reason is errno's text
  IoError(std::string_view doing, std::filesystem::path path, std::string reason, int code);

  const std::filesystem::path& path() const { return path_; }
  const std::string& reason() const { return reason_; }
  int code() const { return code_; }  // an errno; 0 when the file ended before it should
  bool names_no_file() const { return manifests::names_no_file(code_); }

 private:
  std::filesystem::path path_;
  std::string reason_;
  int code_;
};

// Throws IoError with the current errno.
[[noreturn]] void throw_errno(std::string_view doing, const std::filesystem::path& path);

class FileDescriptor {
 public:
  FileDescriptor() = default;
  // Calls open(2) with O_CLOEXEC. Tries again after EINTR and after the errors that pause_before_retry()
  // accepts. A new file gets mode 0666 less the umask. Throws IoError, as all members do.
  FileDescriptor(const std::filesystem::path& path, int flags);
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept;
  FileDescriptor& operator=(FileDescriptor&& other) noexcept;
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  int get() const { return descriptor_; }
  const std::filesystem::path& path() const { return path_; }

  std::uint64_t size() const;
  void write_all(std::span<const std::byte> bytes) const;
  void write_all(std::string_view text) const;
  // Fills `bytes` with the file's content from `offset` on. It does not move the file position, so many
  // threads may call it at once. EINTR and EAGAIN are tried again.
  void read_at(std::uint64_t offset, std::span<std::byte> bytes) const;
  void sync() const;
  // Closes the file. Network file systems report a failed write only here, so whoever wrote must call it.
  void close();

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

// Returns whether a call that failed with this errno is worth another try. These errors are EAGAIN, and
// ESTALE, which network disks return while their server restarts. In that case it first sleeps 50, 200 or 800
// ms, depending on `attempt` (0, 1, 2), and leaves errno as it was. Returns false after the last try.
bool pause_before_retry(int code, int attempt);

// Opens a regular file for reading. Throws IoError, also for a folder, pipe or device. A named pipe without a
// writer does not make the caller wait.
FileDescriptor open_input(const std::filesystem::path& path);

// Opens a regular file and returns read(file). If the server of a network disk has forgotten the open file
// (ESTALE), the file is opened again and `read` begins anew, so that what it returns comes from one opening.
template <typename Read>
auto read_input(const std::filesystem::path& path, Read&& read) {
  for (int attempt = 0;; ++attempt) {
    const FileDescriptor file = open_input(path);
    try {
      return read(file);
    } catch (const IoError& error) {
      if (error.code() != ESTALE || !pause_before_retry(ESTALE, attempt)) throw;
    }
  }
}

// Returns read(), or nothing if it throws an IoError that says that there is no such file.
template <typename Read>
auto if_present(Read&& read) -> std::optional<decltype(read())> {
  try {
    return read();
  } catch (const IoError& error) {
    if (error.names_no_file()) return std::nullopt;
    throw;
  }
}

// Returns the whole content of a regular file, read once. Throws IoError, also if the file shrinks meanwhile.
std::vector<std::byte> read_bytes(const std::filesystem::path& path);

}  // namespace q3d::manifests
