// Makes writes fail as on a full disk: no file of this process may grow beyond a size.
#pragma once

#include <sys/resource.h>

#include <csignal>

namespace q3d::testing {

class FullDisk {
 public:
  explicit FullDisk(rlim_t max_file_bytes) {
    old_handler_ = std::signal(SIGXFSZ, SIG_IGN);  // write(2) then fails with EFBIG instead of a signal
    ::getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{max_file_bytes, old_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit old_{};
  void (*old_handler_)(int) = SIG_DFL;
};

}  // namespace q3d::testing
