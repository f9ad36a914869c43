#include "manifests/lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <ctime>
#include <stdexcept>

#include "manifests/atomic_file.h"

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

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder) : file_(folder / ".lock", O_RDWR | O_CREAT) {
  if (::flock(file_.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) throw_errno("lock", file_.path());
    const std::string holder = read_file(file_.path());
    throw std::runtime_error(fmt::format(
        "{} is in use by another build ({}). Wait for it or end it, or choose another output folder.",
        folder.string(), holder.empty() ? "it has not said which" : holder));
  }
  if (::ftruncate(file_.get(), 0) != 0) throw_errno("write", file_.path());
  file_.write_all(describe_this_process());
}

}  // namespace q3d::manifests
