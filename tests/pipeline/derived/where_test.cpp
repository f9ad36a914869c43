#include "pipeline/derived/where.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::derived {
namespace {

using ::testing::HasSubstr;

class Where : public ::testing::Test {
 protected:
  Where() {
    row_.id = "zoo/train/a.jpg#0";
    row_.species = "red fox";
    row_.family = manifests::Family::canidae;
    row_.judgement.verdict = manifests::Verdict::refined;
    row_.judgement.final_error = 0.02;
    row_.judgement.trust.combined = 0.9;
  }
  bool holds(const std::string& condition) const {
    return parse_where(condition)({row_, manifests::LabelKind::refined});
  }
  dataset::VerdictRow row_;
};

TEST_F(Where, FieldsAreCompared) {
  EXPECT_TRUE(holds("species = \"red fox\""));
  EXPECT_FALSE(holds("species = fox"));
  EXPECT_TRUE(holds("species != fox"));
  EXPECT_TRUE(holds("family=canidae"));
  EXPECT_TRUE(holds("verdict = refined and label_kind = refined"));
  EXPECT_TRUE(holds("trust > 0.8"));
  EXPECT_FALSE(holds("trust > 0.9"));
  EXPECT_TRUE(holds("trust>=0.9"));
  EXPECT_TRUE(holds("final_error < 2.1e-2"));
  EXPECT_TRUE(holds("id = zoo/train/a.jpg#0"));
}

TEST_F(Where, AndBindsCloserThanOrAndNotClosest) {
  EXPECT_TRUE(holds("species = cow and trust > 1 or family = canidae"));
  EXPECT_FALSE(holds("species = cow and (trust > 1 or family = canidae)"));
  EXPECT_FALSE(holds("not family = canidae and trust > 0.5"));
  EXPECT_TRUE(holds("not (family = canidae and trust > 0.95)"));
  EXPECT_TRUE(holds("not not family = canidae"));
}

TEST_F(Where, ANumberThatWasNotComputedFulfilsNoComparison) {
  for (const char* condition : {"gain > 0", "gain <= 0", "gain = 0", "trust_mirror < 100"}) {
    EXPECT_FALSE(holds(condition)) << condition;
  }
  EXPECT_TRUE(holds("gain != 0"));
}

TEST_F(Where, MistakesAreToldWithTheirPlace) {
  const auto message = [](const std::string& condition) {
    try {
      parse_where(condition);
    } catch (const run::ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("nothing thrown");
  };
  EXPECT_THAT(message("colour = red"), HasSubstr("got \"colour\" at character 1, expected one of dataset, "));
  EXPECT_THAT(message("species > fox"), HasSubstr("got \">\" at character 9, expected = or !="));
  EXPECT_THAT(message("trust > high"), HasSubstr("got \"high\" at character 9, expected a number"));
  EXPECT_THAT(message("species = red fox"), HasSubstr("got \"fox\" at character 15"));
  EXPECT_THAT(message("species = red fox"), HasSubstr("a value with spaces stands between double quotes"));
  EXPECT_THAT(message("verdict = kept"),
              HasSubstr("got \"kept\" at character 11, expected one of retained, "));
  EXPECT_THAT(message("label_kind != \"\" and reason = none"), HasSubstr("nothing thrown"));
  EXPECT_THAT(message("(trust > 1"), HasSubstr("got the end at character 11, expected \")\""));
  EXPECT_THAT(message("species ="), HasSubstr("expected a value"));
  EXPECT_THAT(message("species = \"red fox"), HasSubstr("has no closing quote"));
  EXPECT_THAT(message(""), HasSubstr("got the end"));
}

TEST_F(Where, AConditionHasABoundedNumberOfParts) {
  const auto repeated = [](const std::string& text, int times) {
    std::string all;
    for (int i = 0; i < times; ++i) all += text;
    return all;
  };
  for (const std::string& text :
       {repeated("(", 50'000) + "id = a" + repeated(")", 50'000), repeated("not ", 50'000) + "id = a",
        "id = a" + repeated(" and id = a", 20'000)}) {
    EXPECT_THROW(parse_where(text), run::ConfigError);
  }
  EXPECT_NO_THROW(parse_where("id = a" + repeated(" or id = b", 900)));
}

}  // namespace
}  // namespace q3d::pipeline::derived
