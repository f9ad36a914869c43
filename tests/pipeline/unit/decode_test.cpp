// The decoded bytes are those that were digested, or the run stops.
#include "pipeline/unit/decode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

#include "manifests/digest.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::unit {
namespace {

namespace fs = std::filesystem;
using manifests::Reason;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Decode : public ::testing::Test {
 protected:
  Decode() {
    save(picture_, cv::Mat(60, 80, CV_8UC3, cv::Scalar(10, 120, 200)));
    cv::Mat silhouette(60, 80, CV_8UC1, cv::Scalar(0));
    silhouette(cv::Rect(20, 20, 30, 20)) = 255;
    save(mask_, silhouette);
    candidate_.record.id = "herd/train/p.png#0";
    candidate_.record.image_path = picture_;
    candidate_.record.mask_path = mask_;
    candidate_.record.box = {10.0, 10.0, 50.0, 40.0};
    candidate_.image_sha256 = manifests::sha256_file(picture_);
    candidate_.mask_sha256 = manifests::sha256_file(mask_);
  }

  static void save(const fs::path& path, const cv::Mat& picture) { cv::imwrite(path.string(), picture); }
  static void append(const fs::path& path) { std::ofstream(path, std::ios::app) << "more"; }

  DecodedSample decoded() const { return decode_sample(candidate_, {.patch = true}, {}); }
  // Returns the message with which decoding stops the run.
  std::string refusal() const {
    try {
      decoded();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "no refusal";
  }

  testing::ScratchDir scratch_;
  fs::path picture_ = scratch_.path() / "p.png";
  fs::path mask_ = scratch_.path() / "m.png";
  candidates::Candidate candidate_;
};

TEST_F(Decode, TheFilesThatWereDigestedAreUsed) {
  EXPECT_EQ(decoded().failure, Reason::none);
  EXPECT_TRUE(decoded().has_mask);
}

TEST_F(Decode, FilesThatWereReplacedAreRefused) {
  append(mask_);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(mask_.string()), HasSubstr("replaced or damaged"),
                               HasSubstr(candidate_.mask_sha256), HasSubstr("remove digests.txt")));
  append(picture_);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(picture_.string()), HasSubstr("replaced or damaged"),
                               HasSubstr(candidate_.image_sha256)));
}

// A damaged picture is not an undecodable one: its digest says that it was another.
TEST_F(Decode, APictureThatWasCutShortIsRefusedAndGetsNoVerdict) {
  fs::resize_file(picture_, fs::file_size(picture_) / 2);
  EXPECT_THAT(refusal(), HasSubstr("replaced or damaged"));
}

TEST_F(Decode, FilesThatAreGoneAreRefused) {
  fs::remove(mask_);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(mask_.string()), HasSubstr("could be read before")));
  fs::remove(picture_);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(picture_.string()), HasSubstr("could be read before")));
}

TEST_F(Decode, AMaskThatAppearsLaterIsRefused) {
  candidate_.mask_sha256.clear();
  EXPECT_THAT(refusal(), AllOf(HasSubstr(mask_.string()), HasSubstr("there was no file")));
}

TEST_F(Decode, AMissingMaskThatNeverWasThereIsNoMask) {
  candidate_.mask_sha256.clear();
  fs::remove(mask_);
  EXPECT_EQ(decoded().failure, Reason::none);
  EXPECT_FALSE(decoded().has_mask);
}

TEST_F(Decode, CandidatesWithoutDigestsAreNotCompared) {
  candidate_.image_sha256.clear();
  candidate_.mask_sha256.clear();
  EXPECT_TRUE(decoded().has_mask);
  fs::remove(picture_);
  EXPECT_EQ(decoded().failure, Reason::image_missing);
}

}  // namespace
}  // namespace q3d::pipeline::unit
