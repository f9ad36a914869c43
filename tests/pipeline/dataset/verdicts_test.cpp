#include "pipeline/dataset/verdicts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <utility>

#include "manifests/atomic_file.h"
#include "tests/pipeline/dataset/made_dataset.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::Reason;
using manifests::Verdict;
using ::testing::HasSubstr;

class Verdicts : public ::testing::Test {
 protected:
  std::vector<VerdictRow> read(const std::string& text) {
    manifests::write_file_atomically(file_, text);
    VerdictReader reader(file_);
    std::vector<VerdictRow> rows;
    while (auto row = reader.next()) rows.push_back(std::move(*row));
    return rows;
  }
  // Returns the error message for the table in which `from` was replaced by `to`.
  std::string message(const std::string& from, const std::string& to) {
    std::string text = kVerdicts;
    text.replace(text.find(from), from.size(), to);
    try {
      read(text);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "nothing thrown";
  }

  q3d::testing::ScratchDir folder_;
  std::filesystem::path file_ = folder_.path() / "verdicts.csv";
};

TEST_F(Verdicts, AreReadAsEnumeratorsAndNumbers) {
  const std::vector<VerdictRow> rows = read(kVerdicts);
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_EQ(rows[1].judgement.verdict, Verdict::failed);
  EXPECT_EQ(rows[1].judgement.reason, Reason::image_empty);
  EXPECT_EQ(rows[1].judgement.detail, "got 0 bytes, expected a picture");
  EXPECT_FALSE(rows[1].label);
  EXPECT_FALSE(rows[1].is_judged());
  EXPECT_EQ(rows[2].position, 2U);
  EXPECT_EQ(rows[2].judgement.initial_error, 0.09);
  EXPECT_TRUE(std::isnan(rows[2].judgement.gain));
  EXPECT_EQ(rows[2].family, manifests::Family::bovidae);
  EXPECT_EQ(rows[2].source, "web");
  ASSERT_TRUE(rows[3].label);
  EXPECT_EQ(rows[3].label->shard, 1);
  EXPECT_EQ(rows[3].label->row, 0);
}

TEST_F(Verdicts, TrustScoresAreReadWhereTheFileHasThem) {
  EXPECT_TRUE(std::isnan(read(kVerdicts)[0].judgement.trust.combined)) << "a file from before schema 2";
  std::string text = kVerdicts;
  const auto put = [&](const std::string& after, const std::string& more) {
    text.insert(text.find(after) + after.size(), more);
  };
  put("best_iteration", ",trust,trust_mirror");
  put("zoo/train/a.jpg#0,retained,none,,,,,", ",0.75,31.5");
  put("zoo/train/b.jpg#1,failed,image_empty,,,,,", ",,");
  put("pool/test/c.jpg#2,discarded,error_too_large,0.09,0.09,,0,0", ",,");
  put("zoo/train/d.jpg#3,retained,none,,,,,", ",,");
  const std::vector<VerdictRow> rows = read(text);
  EXPECT_EQ(rows[0].judgement.trust.combined, 0.75);
  EXPECT_EQ(rows[0].judgement.trust.mirror, 31.5);
  EXPECT_TRUE(std::isnan(rows[0].judgement.trust.aux_2d));
  EXPECT_TRUE(std::isnan(rows[2].judgement.trust.combined));
  EXPECT_EQ(rows[2].dataset, "pool");
}

TEST_F(Verdicts, RefusesWhatIsNoVerdict) {
  EXPECT_THAT(message("retained,none", "kept,none"), HasSubstr("line 2: got unknown verdict \"kept\""));
  EXPECT_THAT(message("error_too_large", "too_bad"), HasSubstr("line 4: got unknown reason \"too_bad\""));
  EXPECT_THAT(message("0.09,0.09", "0.09,x"), HasSubstr("line 4: got \"x\" for final_error"));
  EXPECT_THAT(message("canidae,0,0,aa", "canidae,0,0.5,aa"), HasSubstr("expected a whole number"));
  EXPECT_THAT(message("reason,initial", "why,initial"), HasSubstr("got no column \"reason\""));
}

TEST_F(Verdicts, RefusesARowThatContradictsItself) {
  EXPECT_THAT(message("canidae,0,0,aa", "canidae,,,aa"), HasSubstr("got no row in a shard"));
  EXPECT_THAT(message("bovidae,,,cc", "bovidae,0,1,cc"), HasSubstr("got a row in a shard"));
  EXPECT_THAT(message("retained,none", "retained,vetoed"), HasSubstr("got the reason vetoed"));
  EXPECT_THAT(message("discarded,error_too_large", "discarded,none"), HasSubstr("got the reason none"));
}

}  // namespace
}  // namespace q3d::pipeline::dataset
