#include "manifests/link_file.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "manifests/atomic_file.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;

constexpr fs::perms kReadOnly = fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read;
constexpr uid_t kNobody = 65534;

class LinkFile : public ::testing::Test {
 protected:
  LinkFile() {
    fs::permissions(scratch_.path(), fs::perms::all);
    write_file_atomically(from_, "content");
    fs::permissions(from_, kReadOnly);
  }

  testing::ScratchDir scratch_;
  fs::path from_ = scratch_.path() / "from";
  fs::path to_ = scratch_.path() / "to";
};

TEST_F(LinkFile, GivesTheFileASecondName) {
  link_or_copy(from_, to_);
  EXPECT_TRUE(fs::equivalent(from_, to_));
  link_or_copy(from_, to_);  // again
  EXPECT_EQ(read_file(to_), "content");
}

// The kernel lets nobody link a file of somebody else that they cannot write (fs.protected_hardlinks).
TEST_F(LinkFile, CopiesWhereItCannotLinkAlsoForAPlainUser) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can take the place of another user";
  const pid_t child = ::fork();
  if (child == 0) {
    if (::setuid(kNobody) != 0) ::_exit(2);
    try {
      link_or_copy(from_, to_);
    } catch (const std::exception&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(read_file(to_), "content");
  EXPECT_EQ(fs::status(to_).permissions(), kReadOnly);
}

}  // namespace
}  // namespace q3d::manifests
