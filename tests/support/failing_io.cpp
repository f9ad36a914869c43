#include "tests/support/failing_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string_view>

namespace q3d::testing {
namespace {

struct Plan {
  Call call;
  std::string ending;
  int code;
  int times;
};

std::mutex mutex;
const Plan* plan = nullptr;  // guarded by mutex
std::set<int> opened_later;  // descriptors that were opened while the plan was there; guarded by mutex
std::atomic<int> failed = 0;

// Returns the errno with which the call must fail, or 0 if it must pass.
int verdict(Call call, std::string_view path) {
  const std::lock_guard lock(mutex);
  if (plan == nullptr || plan->call != call || !path.ends_with(plan->ending)) return 0;
  if (plan->times >= 0 && failed >= plan->times) return 0;
  ++failed;
  return plan->code;
}

int open_or_fail(const char* path, int flags, mode_t mode) {
  if (const int code = verdict(Call::open, path)) {
    errno = code;
    return -1;
  }
  const int descriptor = static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
  const std::lock_guard lock(mutex);
  if (plan != nullptr) opened_later.insert(descriptor);
  return descriptor;
}

Call call_of_read(int descriptor) {
  const std::lock_guard lock(mutex);
  const bool asks_for_age = plan != nullptr && plan->call == Call::read_forgotten;
  return asks_for_age && !opened_later.contains(descriptor) ? Call::read_forgotten : Call::read;
}

ssize_t read_or_fail(int descriptor, void* buffer, std::size_t count, off_t offset) {
  std::array<char, 4096> path{};
  const std::string link = "/proc/self/fd/" + std::to_string(descriptor);
  const ssize_t length = ::readlink(link.c_str(), path.data(), path.size());
  if (length > 0) {
    if (const int code = verdict(call_of_read(descriptor), {path.data(), static_cast<std::size_t>(length)})) {
      errno = code;
      return -1;
    }
  }
  return ::syscall(SYS_pread64, descriptor, buffer, count, offset);
}

int inspect_or_fail(const char* path, struct stat* status) {
  if (const int code = verdict(Call::inspect, path)) {
    errno = code;
    return -1;
  }
  return ::fstatat(AT_FDCWD, path, status, AT_SYMLINK_NOFOLLOW);
}

mode_t mode_argument(int flags, std::va_list arguments) {
  const bool has_mode = (flags & (O_CREAT | O_TMPFILE)) != 0;
  return has_mode ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
}

}  // namespace

FailingIo::FailingIo(Call call, std::string ending, int code, int times) {
  const std::lock_guard lock(mutex);
  if (plan != nullptr) throw std::logic_error("one FailingIo at a time");
  failed = 0;
  opened_later.clear();
  plan = new Plan{call, std::move(ending), code, times};
}

FailingIo::~FailingIo() {
  const std::lock_guard lock(mutex);
  delete plan;
  plan = nullptr;
}

int FailingIo::failures() const {
  return failed;
}

}  // namespace q3d::testing

// NOLINTBEGIN(readability-inconsistent-declaration-parameter-name): the C library's names are reserved.
extern "C" {

int open(const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = q3d::testing::mode_argument(flags, arguments);
  va_end(arguments);
  return q3d::testing::open_or_fail(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = q3d::testing::mode_argument(flags, arguments);
  va_end(arguments);
  return q3d::testing::open_or_fail(path, flags, mode);
}

ssize_t pread(int descriptor, void* buffer, std::size_t count, off_t offset) {
  return q3d::testing::read_or_fail(descriptor, buffer, count, offset);
}

ssize_t pread64(int descriptor, void* buffer, std::size_t count, off64_t offset) {
  return q3d::testing::read_or_fail(descriptor, buffer, count, offset);
}

int lstat(const char* path, struct stat* status) {
  return q3d::testing::inspect_or_fail(path, status);
}

}  // extern "C"
// NOLINTEND(readability-inconsistent-declaration-parameter-name)
