#include "pipeline/dataset/sentences.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <set>
#include <stdexcept>
#include <string>

#include "manifests/enumerators.h"

namespace q3d::pipeline::dataset {
namespace {

using config::Role;
using manifests::Judgement;
using manifests::LabelKind;
using manifests::Reason;
using manifests::Verdict;
using ::testing::HasSubstr;
using ::testing::Not;

const filters::Thresholds kThresholds{.tau_low = 0.04, .tau_high = 0.08, .delta = 0.05};

// Every enumerator, in the order of its names, has a sentence that no other one has.
template <typename Enum>
void expect_own_sentences(std::span<const std::string_view> names) {
  std::set<std::string_view> seen;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto each = static_cast<Enum>(i);
    SCOPED_TRACE(names[i]);
    ASSERT_EQ(manifests::to_string(each), names[i]);
    const std::string_view told = sentence(each);
    EXPECT_GT(told.size(), 20U);
    EXPECT_TRUE(std::isupper(static_cast<unsigned char>(told.front())));
    EXPECT_EQ(told.back(), '.');
    EXPECT_TRUE(seen.insert(told).second) << "another one has this sentence: " << told;
  }
  // A name is missing where an enumerator follows the last name.
  EXPECT_THROW(sentence(static_cast<Enum>(names.size())), std::logic_error);
}

TEST(Sentence, EveryVerdictHasItsOwn) {
  expect_own_sentences<Verdict>(manifests::verdict_names());
}

TEST(Sentence, EveryReasonHasItsOwn) {
  expect_own_sentences<Reason>(manifests::reason_names());
}

TEST(Sentence, EveryKindOfLabelHasItsOwn) {
  expect_own_sentences<LabelKind>(manifests::label_kind_names());
}

Judgement judgement(Verdict verdict, Reason reason, const std::string& detail = {}) {
  Judgement made;
  made.verdict = verdict;
  made.reason = reason;
  made.detail = detail;
  made.initial_error = 0.06;
  made.final_error = 0.05;
  made.gain = 0.02;
  made.iterations = 30;
  made.best_iteration = 17;
  return made;
}

// Whatever the numbers say, a candidate with a reason is explained by it and never as kept.
TEST(Why, EveryReasonIsToldAndNoneIsTakenForKept) {
  for (std::size_t i = 1; i < manifests::reason_names().size(); ++i) {
    const auto reason = static_cast<Reason>(i);
    SCOPED_TRACE(manifests::to_string(reason));
    for (const Verdict verdict : {Verdict::discarded, Verdict::failed}) {
      const std::string told = why(judgement(verdict, reason, "got 3"), Role::pseudo, kThresholds);
      std::string own(sentence(reason));
      own.pop_back();  // the detail may follow in the same sentence
      EXPECT_THAT(told, HasSubstr(own));
      EXPECT_THAT(told, Not(HasSubstr("kept")));
    }
  }
}

TEST(Why, NamesTheNumbersThatDecided) {
  EXPECT_EQ(
      why(judgement(Verdict::discarded, Reason::error_too_large), Role::pseudo, kThresholds),
      "The prediction lies too far from the annotated keypoints to be refined. L_proj of the prediction, "
      "0.0600, reaches tau_high = 0.0800.");
  EXPECT_THAT(
      why(judgement(Verdict::discarded, Reason::gain_too_small), Role::pseudo, kThresholds),
      ::testing::AllOf(HasSubstr("In 30 iterations L_proj fell to 0.0500, which it reached at iteration 17."),
                       HasSubstr("2.00 %, is less than delta = 5.00 %.")));
  Judgement retained = judgement(Verdict::retained, Reason::none);
  retained.initial_error = 0.03;
  retained.iterations = 0;
  EXPECT_EQ(why(retained, Role::pseudo, kThresholds),
            "L_proj of the prediction, 0.0300, lies below tau_low = 0.0400, so it was kept.");
  Judgement refined = judgement(Verdict::refined, Reason::none);
  refined.gain = 0.12;
  EXPECT_THAT(why(refined, Role::pseudo, kThresholds),
              HasSubstr("12.00 %, reaches delta = 5.00 %, so it was kept."));
  refined.final_error = 0.03;
  EXPECT_THAT(why(refined, Role::pseudo, kThresholds), HasSubstr("12.00 %, reaches delta"))
      << "the gain decides, wherever L_proj ends";
  refined.gain = 0.02;
  EXPECT_THAT(why(refined, Role::pseudo, kThresholds),
              HasSubstr("told to end there before its gain was asked for, so it was kept."));
}

TEST(Why, TellsHowARetainedPredictionWasAdapted) {
  Judgement better = judgement(Verdict::refined, Reason::none);
  better.initial_error = 0.03;
  better.final_error = 0.02;
  EXPECT_EQ(
      why(better, Role::pseudo, kThresholds),
      "L_proj of the prediction, 0.0300, lies below tau_low = 0.0400, and it was adapted all the same, as "
      "tta.refine_retained asks for. In 30 iterations L_proj fell to 0.0200, which it reached at iteration "
      "17. It is kept with this better body.");
  Judgement no_better = judgement(Verdict::retained, Reason::none);
  no_better.initial_error = no_better.final_error = 0.03;
  no_better.best_iteration = 0;
  EXPECT_EQ(
      why(no_better, Role::pseudo, kThresholds),
      "L_proj of the prediction, 0.0300, lies below tau_low = 0.0400, so it was kept, and adaptation found "
      "nothing better.");
}

TEST(Why, TellsTheDetailOfAGuardOfTheUserAndOfAFailure) {
  const auto told = [](Verdict verdict, Reason reason, const char* detail) {
    return why(judgement(verdict, reason, detail), Role::pseudo, kThresholds);
  };
  EXPECT_EQ(told(Verdict::discarded, Reason::mask_mismatch, "mask_iou 0.2, mask_iou_min 0.5"),
            "A guard left it out: the body's silhouette and the mask overlap too little (mask_iou 0.2, "
            "mask_iou_min 0.5).");
  EXPECT_EQ(told(Verdict::discarded, Reason::vetoed, "the tail is bent"),
            "It was left out by the veto list: the tail is bent.");
  EXPECT_EQ(told(Verdict::failed, Reason::image_empty, ""), "The picture's file is empty.");
}

TEST(Why, LabelsOfTheFileAreNotJudgedByTheFidelityRule) {
  const std::string truth = why(judgement(Verdict::retained, Reason::none), Role::truth, std::nullopt);
  const std::string flat = why(judgement(Verdict::retained, Reason::none), Role::two_d_only, std::nullopt);
  EXPECT_THAT(truth, HasSubstr("body of the annotation file"));
  EXPECT_THAT(flat, HasSubstr("without a body"));
  EXPECT_THROW(why(judgement(Verdict::retained, Reason::none), Role::pseudo, std::nullopt),
               std::runtime_error);
}

}  // namespace
}  // namespace q3d::pipeline::dataset
