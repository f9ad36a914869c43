#include "manifests/lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <ctime>
#include <stdexcept>
#include <system_error>

#include "manifests/atomic_file.h"
#include "manifests/durability.h"

namespace q3d::manifests {
namespace {

std::string describe_this_process() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = '?';
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> start{};
  std::strftime(start.data(), start.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return fmt::format("process {} on host {}, started {}", ::getpid(), host.data(), start.data());
}

// O_NOFOLLOW is set because a symbolic link of this name would let its author choose the file that is
// overwritten.
FileDescriptor open_lock(const std::filesystem::path& file) {
  try {
    return FileDescriptor(file, O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK);
  } catch (const IoError& error) {
    if (error.code() != ELOOP) throw;
    throw IoError("lock", file,
                  "it is a symbolic link, expected a file of the program's own; remove the link", ELOOP);
  }
}

bool has_no_locks(int code) {
  return code == ENOLCK || code == ENOTSUP || code == EINVAL || code == ENOSYS;
}

// Returns 0 or an errno.
int lock(int descriptor) {
  while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EINTR) return errno;
  }
  return 0;
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder) : file_(open_lock(folder / ".lock")) {
  if (!durability().locks) return;
  if (const int code = lock(file_.get()); code != 0) {
    if (has_no_locks(code)) {
      throw IoError(
          "lock", file_.path(),
          std::generic_category().message(code) +
              ". This file system has no locks. Choose a folder on another one, or give --no-lock and "
              "see to it that no other program works in this folder",
          code);
    }
    if (code != EWOULDBLOCK) throw IoError("lock", file_.path(), code);
    const std::string holder = read_file(file_.path());
    throw std::runtime_error(fmt::format(
        "{} is in use by another build ({}). Wait for it or end it, or choose another output folder.",
        folder.string(), holder.empty() ? "it has not said which" : holder));
  }
  if (::ftruncate(file_.get(), 0) != 0) throw_errno("write", file_.path());
  file_.write_all(describe_this_process());
}

}  // namespace q3d::manifests
