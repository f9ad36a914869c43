#include "manifests/file_descriptor.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cerrno>
#include <fstream>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "tests/support/failing_io.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using testing::Call;
using testing::FailingIo;

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

class InputFile : public ::testing::Test {
 protected:
  InputFile() { std::ofstream(path_) << "content"; }

  // The error that reading `path` throws.
  static IoError error_of(const fs::path& path) {
    try {
      read_bytes(path);
    } catch (const IoError& error) {
      return error;
    }
    throw std::logic_error("read_bytes did not throw");
  }

  testing::ScratchDir scratch_;
  fs::path path_ = scratch_.path() / "file";
};

TEST_F(InputFile, ReadsTheWholeContent) {
  EXPECT_EQ(read_bytes(path_), bytes_of("content"));
  std::ofstream(scratch_.path() / "empty").flush();
  EXPECT_TRUE(read_bytes(scratch_.path() / "empty").empty());
}

TEST_F(InputFile, AnErrorNamesOperationPathAndReason) {
  {
    const FailingIo io(Call::read, "/file", EIO);
    const IoError error = error_of(path_);
    EXPECT_EQ(error.what(), "cannot read " + path_.string() + ": Input/output error");
    EXPECT_EQ(error.path(), path_);
    EXPECT_EQ(error.reason(), "Input/output error");
    EXPECT_EQ(error.code(), EIO);
  }
  const FailingIo io(Call::open, "/file", EMFILE);
  EXPECT_EQ(error_of(path_).what(), "cannot open " + path_.string() + ": Too many open files");
}

TEST_F(InputFile, InterruptedCallsAreRepeated) {
  for (const Call call : {Call::open, Call::read}) {
    const FailingIo io(call, "/file", EINTR, 3);
    EXPECT_EQ(read_bytes(path_), bytes_of("content"));
    EXPECT_EQ(io.failures(), 3);
  }
}

// A server that starts again answers ESTALE for a moment, and a busy one EAGAIN.
TEST_F(InputFile, WhatMayPassIsTriedAgain) {
  for (const int code : {EAGAIN, ESTALE}) {
    for (const Call call : {Call::open, Call::read}) {
      {
        const FailingIo io(call, "/file", code, 2);
        EXPECT_EQ(read_bytes(path_), bytes_of("content"));
        EXPECT_EQ(io.failures(), 2);
      }
      const FailingIo io(call, "/file", code);
      EXPECT_EQ(error_of(path_).code(), code) << "in the end it gives up";
      EXPECT_EQ(io.failures(), 4);
    }
    const FailingIo io(Call::read, "/file", code, 1);
    EXPECT_EQ(sha256_file(path_), sha256(std::string_view("content")));
  }
  const FailingIo io(Call::read, "/file", EIO);
  EXPECT_EQ(error_of(path_).code(), EIO);
  EXPECT_EQ(io.failures(), 1) << "an error of the disk is told at once";
}

TEST_F(InputFile, WhatIsNotThereIsToldApartFromWhatCannotBeRead) {
  fs::create_symlink("file_that_is_not_there", scratch_.path() / "broken");
  fs::create_symlink("loop", scratch_.path() / "loop");
  ASSERT_EQ(::mkfifo((scratch_.path() / "pipe").c_str(), 0600), 0);
  for (const fs::path& name :
       {fs::path("absent"), fs::path("file/below"), fs::path("broken"), fs::path("loop"), fs::path("."),
        fs::path("pipe"), fs::path(std::string(300, 'x'))}) {
    EXPECT_TRUE(error_of(scratch_.path() / name).names_no_file()) << name;
  }
  for (const int code : {EIO, ESTALE, EMFILE, ENFILE, ENOMEM, EAGAIN, ENOTCONN, ETIMEDOUT, EACCES, EPERM}) {
    for (const Call call : {Call::open, Call::read}) {
      const FailingIo io(call, "/file", code);
      EXPECT_FALSE(error_of(path_).names_no_file()) << code;
    }
  }
}

TEST_F(InputFile, AFileThatShrinksWhileItIsReadIsAnErrorOfNoErrno) {
  const FileDescriptor file = open_input(path_);
  std::vector<std::byte> bytes(file.size());
  fs::resize_file(path_, 3);
  try {
    file.read_at(0, bytes);
    FAIL();
  } catch (const IoError& error) {
    EXPECT_EQ(error.code(), 0);
    EXPECT_FALSE(error.names_no_file());
  }
}

TEST_F(InputFile, TheDigestOfAnAbsentFileIsNothingAndThatOfAnUnreadableOneThrows) {
  DigestCache digests(scratch_.path() / "digests.txt");
  EXPECT_EQ(digests.digest_if_present(path_), sha256(std::string_view("content")));
  EXPECT_EQ(digests.digest_if_present(scratch_.path() / "absent"), std::nullopt);
  EXPECT_EQ(digests.digest_if_present(scratch_.path()), std::nullopt);
  const FailingIo io(Call::read, "/file", ESTALE);
  EXPECT_THROW(digests.digest_if_present(path_), IoError);
}

}  // namespace
}  // namespace q3d::manifests
