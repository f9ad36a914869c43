// Makes the system refuse to open or read chosen files, as a broken disk or network mount does.
//
// The library replaces open(2), pread(2) and lstat(2) for the whole test program; calls on
// other files pass through to the system.
#pragma once

#include <string>

namespace q3d::testing {

enum class Call {
  open,
  read,
  read_forgotten,  // reads through descriptors that were open when the object was made
  inspect
};

// While it lives, `call` on every file whose path ends in `ending` fails with errno `code`: `times` times, or
// always if that is negative. Only one object may exist at a time.
class FailingIo {
 public:
  FailingIo(Call call, std::string ending, int code, int times = -1);
  ~FailingIo();
  FailingIo(const FailingIo&) = delete;
  FailingIo& operator=(const FailingIo&) = delete;

  int failures() const;  // calls that failed so far
};

}  // namespace q3d::testing
