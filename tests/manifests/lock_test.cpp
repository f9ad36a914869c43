#include "manifests/lock.h"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>

#include "manifests/atomic_file.h"
#include "manifests/durability.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(FolderLock, RefusesASecondHolderAndNamesTheFirst) {
  const testing::ScratchDir scratch;
  std::array<char, 256> host{};
  ASSERT_EQ(::gethostname(host.data(), host.size() - 1), 0);
  {
    const FolderLock lock(scratch.path());
    EXPECT_THAT(
        [&] { FolderLock second(scratch.path()); },
        ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(scratch.path().string()), HasSubstr(host.data()),
                                                HasSubstr("process " + std::to_string(::getpid())))));
  }
  EXPECT_NO_THROW(FolderLock again(scratch.path()));
}

TEST(FolderLock, TheKernelDropsItWhenTheHolderIsKilled) {
  const testing::ScratchDir scratch;
  int channel[2];
  ASSERT_EQ(::pipe(channel), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const FolderLock lock(scratch.path());
    if (::write(channel[1], "x", 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char locked = 0;
  ASSERT_EQ(::read(channel[0], &locked, 1), 1);
  EXPECT_THAT([&] { FolderLock second(scratch.path()); },
              ThrowsMessage<std::runtime_error>(HasSubstr("process " + std::to_string(child))));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ::close(channel[0]);
  ::close(channel[1]);
  EXPECT_NO_THROW(FolderLock again(scratch.path()));
}

TEST(FolderLock, ALinkOfItsNameIsRefusedAndItsTargetStays) {
  const testing::ScratchDir scratch;
  write_file_atomically(scratch.path() / "victim", "precious");
  std::filesystem::create_symlink("victim", scratch.path() / ".lock");
  EXPECT_THAT(
      [&] { FolderLock lock(scratch.path()); },
      ThrowsMessage<IoError>(HasSubstr("it is a symbolic link, expected a file of the program's own")));
  EXPECT_EQ(read_file(scratch.path() / "victim"), "precious");
}

TEST(FolderLock, IsNotTakenWhereTheUserWantsNone) {
  const testing::ScratchDir scratch;
  const FolderLock lock(scratch.path());
  set_durability({.locks = false});
  EXPECT_NO_THROW(FolderLock second(scratch.path()));
  set_durability({});
  EXPECT_THROW(FolderLock third(scratch.path()), std::runtime_error);
}

TEST(FolderLock, NamesAFolderThatIsAbsent) {
  const testing::ScratchDir scratch;
  EXPECT_THAT([&] { FolderLock lock(scratch.path() / "absent"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("absent/.lock: No such file or directory")));
}

}  // namespace
}  // namespace q3d::manifests
