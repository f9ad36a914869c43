// A reader of pictures and annotation files stops when the system cannot read, or when memory runs out,
// because neither says anything about the file.
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <functional>
#include <new>

#include "loaders/formats/label_table.h"
#include "loaders/formats/picture_finder.h"
#include "loaders/pictures/image.h"
#include "manifests/file_descriptor.h"
#include "manifests/json_file.h"
#include "tests/loaders/formats/annotation_files.h"
#include "tests/support/failing_io.h"

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;
using manifests::Reason;
using pictures::decode_image;
using pictures::decode_mask;
using pictures::DecodedImage;
using pictures::read_picture_file;
using ::testing::AllOf;
using testing::Call;
using testing::FailingIo;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

void expect_io_error(const std::function<void()>& read, const fs::path& path, int code) {
  EXPECT_THAT(read, ThrowsMessage<manifests::IoError>(
                        AllOf(HasSubstr(path.string()), HasSubstr(std::strerror(code)))));
}

class UnreadablePicture : public ::testing::TestWithParam<int> {
 protected:
  UnreadablePicture() { testing_files::write_picture(path_); }
  testing::ScratchDir scratch_;
  fs::path path_ = scratch_.path() / "picture.png";
};

TEST_P(UnreadablePicture, IsNoFailureOfThePicture) {
  for (const Call call : {Call::open, Call::read}) {
    {
      const FailingIo io(call, "/picture.png", GetParam());
      expect_io_error([&] { read_picture_file(path_); }, path_, GetParam());
      expect_io_error([&] { decode_image(path_); }, path_, GetParam());
      expect_io_error([&] { decode_mask(path_); }, path_, GetParam());
    }
    EXPECT_EQ(decode_image(path_).failure, Reason::none) << "it can be read again";
  }
}

INSTANTIATE_TEST_SUITE_P(Errors, UnreadablePicture,
                         ::testing::Values(EIO, ESTALE, EMFILE, ENFILE, ENOMEM, EAGAIN, ENOTCONN, ETIMEDOUT,
                                           EACCES, EPERM));

TEST(UnreadablePictures, InterruptedReadsAreRepeated) {
  const testing::ScratchDir scratch;
  testing_files::write_picture(scratch.path() / "picture.png");
  const FailingIo io(Call::read, "/picture.png", EINTR, 5);
  EXPECT_EQ(decode_image(scratch.path() / "picture.png").failure, Reason::none);
  EXPECT_EQ(io.failures(), 5);
}

TEST(UnreadablePictures, WhatNamesNoFileIsAFailureOfThePicture) {
  const testing::ScratchDir scratch;
  testing_files::write_picture(scratch.path() / "picture.png");
  ASSERT_EQ(::mkfifo((scratch.path() / "pipe").c_str(), 0600), 0);
  fs::create_symlink("loop", scratch.path() / "loop");
  const auto failure = [&](const std::string& name) {
    return read_picture_file(scratch.path() / name).failure;
  };
  EXPECT_EQ(failure("absent.png"), Reason::image_missing);
  EXPECT_EQ(failure("picture.png/below.png"), Reason::image_missing);
  EXPECT_EQ(failure("loop"), Reason::image_missing);
  EXPECT_EQ(failure(std::string(300, 'x')), Reason::image_missing);
  EXPECT_EQ(failure("pipe"), Reason::image_not_an_image) << "and no wait for a writer";
}

TEST(UnreadableAnnotations, StopTheRunWithTheReason) {
  const testing::ScratchDir scratch;
  const fs::path json = scratch.path() / "train.json";
  const fs::path csv = scratch.path() / "labels.csv";
  testing_files::write_text(json, "{}");
  testing_files::write_text(csv, "scorer,a\n");
  for (const Call call : {Call::open, Call::read}) {
    const FailingIo io(call, "/train.json", EIO);
    expect_io_error([&] { manifests::read_json_file(json); }, json, EIO);
  }
  for (const Call call : {Call::open, Call::read}) {
    const FailingIo io(call, "/labels.csv", ESTALE);
    expect_io_error([&] { read_label_table(csv); }, csv, ESTALE);
  }
  EXPECT_THAT(
      [&] { manifests::read_json_file(scratch.path() / "absent.json"); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("absent.json"), HasSubstr("annotation file"))));
}

// Before a picture is opened, the system is asked whether it is there.
TEST(UnreadableFolders, DoNotMakeAPictureMissing) {
  const testing::ScratchDir scratch;
  testing_files::write_picture(scratch.path() / "images/a.png");
  {
    PictureFinder finder({.root = scratch.path()});
    const FailingIo io(Call::inspect, "/images/a.png", EACCES);
    expect_io_error([&] { finder.find("images/a.png"); }, scratch.path() / "images/a.png", EACCES);
  }
  PictureFinder finder({.root = scratch.path()});
  EXPECT_EQ(finder.find("images/a.png").failure, Reason::none);
  EXPECT_EQ(finder.find("images/b.png").failure, Reason::image_missing);
  EXPECT_EQ(finder.find("images/" + std::string(300, 'b') + ".png").failure, Reason::image_missing);
}

#ifndef __SANITIZE_ADDRESS__  // which reserves terabytes of address space

// Ends the process with 0 when decoding, with `more_bytes` of address space left, throws std::bad_alloc.
[[noreturn]] void decode_with(std::span<const std::byte> picture, rlim_t more_bytes) {
  rlim_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t limit = pages * static_cast<rlim_t>(::getpagesize()) + more_bytes;
  const rlimit address_space{limit, limit};
  if (::setrlimit(RLIMIT_AS, &address_space) != 0) std::_Exit(3);
  try {
    const DecodedImage decoded = decode_image(picture);
    std::_Exit(decoded.failure == Reason::none ? 2 : 1);
  } catch (const std::bad_alloc&) {
    std::_Exit(0);
  }
}

constexpr int kSidePx = 6000;  // 108 MB of pixels
constexpr rlim_t kMegabyte = 1 << 20;

std::vector<unsigned char> big_picture(const std::string& ending, const std::vector<int>& options) {
  std::vector<unsigned char> bytes;
  cv::imencode(ending, cv::Mat(kSidePx, kSidePx, CV_8UC3, cv::Scalar(10, 120, 230)), bytes, options);
  return bytes;
}

TEST(NoMemory, StopsTheRunWhateverTheFormat) {
  for (const std::string ending : {".jpg", ".png"}) {
    const auto bytes = big_picture(ending, {});
    const auto picture = std::as_bytes(std::span(bytes));
    EXPECT_EXIT(decode_with(picture, 50 * kMegabyte), ::testing::ExitedWithCode(0), "") << ending;
    EXPECT_EXIT(decode_with(picture, 1000 * kMegabyte), ::testing::ExitedWithCode(2), "") << ending;
  }
}

// The pixels fit, but not the coefficients that libjpeg keeps of a progressive picture.
TEST(NoMemory, InsideLibjpegStopsTheRun) {
  const auto bytes = big_picture(".jpg", {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  const auto picture = std::as_bytes(std::span(bytes));
  EXPECT_EXIT(decode_with(picture, 150 * kMegabyte), ::testing::ExitedWithCode(0), "");
  EXPECT_EXIT(decode_with(picture, 1000 * kMegabyte), ::testing::ExitedWithCode(2), "");
}

#endif

}  // namespace
}  // namespace q3d::loaders::formats
