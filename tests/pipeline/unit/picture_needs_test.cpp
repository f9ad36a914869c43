// The decision table: which parts of a picture are needed, for every case.
#include "pipeline/unit/picture_needs.h"

#include <gtest/gtest.h>

#include <string>

namespace q3d::pipeline::unit {
namespace {

using manifests::Reason;

// Letters for the parts: p = patch, c = stored crop, m = mask of the patch; "-" = decoded without a part,
// empty = not decoded.
std::string parts(const PictureFacts& facts) {
  const std::optional<Wanted> want = wanted(facts);
  if (!want) return "";
  const std::string letters =
      std::string(want->patch ? "p" : "") + (want->stored_crop ? "c" : "") + (want->patch_mask ? "m" : "");
  return letters.empty() ? "-" : letters;
}

TEST(PictureNeeds, FollowTheTable) {
  struct Case {
    Standing standing;
    bool is_pseudo, lacks_crop, measures_label, has_mask;
    const char* expected;
  };
  const auto unpredicted = Standing::unpredicted;
  const auto to_adapt = Standing::to_adapt;
  const auto may_be_kept = Standing::may_be_kept;
  const auto finished = Standing::finished;
  const std::vector<Case> cases{
      {unpredicted, false, false, false, true, "-"}, {unpredicted, false, true, false, true, "c"},
      {unpredicted, true, false, true, false, "p"},  {unpredicted, true, true, true, false, "pc"},
      {unpredicted, true, false, true, true, "pm"},  {unpredicted, true, true, true, true, "pcm"},
      {to_adapt, true, false, true, false, "p"},     {to_adapt, true, true, true, false, "pc"},
      {to_adapt, true, false, true, true, "pm"},     {to_adapt, true, true, true, true, "pcm"},
      {may_be_kept, false, false, false, true, ""},  {may_be_kept, false, true, false, true, "c"},
      {may_be_kept, true, false, false, true, ""},   {may_be_kept, true, true, false, true, "c"},
      {may_be_kept, true, false, true, false, "p"},  {may_be_kept, true, true, true, false, "pc"},
      {may_be_kept, true, false, true, true, "pm"},  {may_be_kept, true, true, true, true, "pcm"},
      {finished, false, false, false, true, ""},     {finished, false, true, false, true, ""},
      {finished, true, false, true, true, ""},       {finished, true, true, true, true, ""},
  };
  for (const Case& each : cases) {
    EXPECT_EQ(parts({each.standing, each.is_pseudo, each.lacks_crop, each.measures_label, each.has_mask}),
              each.expected)
        << "case " << (&each - cases.data());
  }
}

// One candidate with a prediction that misses its keypoints by `error` crop units, under a middle band of
// [0.2, 0.4).
struct OneCandidate {
  std::vector<candidates::Candidate> candidates{1};
  config::JudgingRules rules;
  UnitWork work;

  explicit OneCandidate(float error = 0.0F) {
    filters::Thresholds& limits = rules.thresholds["d"];
    limits.tau_low = 0.2;
    limits.tau_high = 0.4;
    manifests::SampleRecord& record = candidates[0].record;
    record.dataset = "d";
    record.box = {0, 0, 256, 256};
    record.mask_path = "/mask.png";
    record.keypoints.fill({128.0, 128.0, 1.0F, 1.0F});
    predict(error);
  }
  void predict(float error) {
    set_candidates(work, candidates);
    std::vector<PredictedSample> samples(1);
    samples[0].body.keypoints_2d.fill({error, error});
    set_predictions(work, std::move(samples));
  }
  PictureFacts facts() const { return picture_facts(work, 0, &rules); }
};

TEST(PictureNeeds, AFailedRecordIsFinished) {
  OneCandidate one;
  one.work.predicted.reset();
  EXPECT_EQ(one.facts().standing, Standing::unpredicted);
  one.candidates[0].record.failure = Reason::box_missing;
  EXPECT_EQ(one.facts().standing, Standing::finished);
}

TEST(PictureNeeds, AFailedPredictionIsFinished) {
  OneCandidate one;
  EXPECT_EQ(one.facts().standing, Standing::may_be_kept);
  one.work.predicted->front().failure = Reason::prediction_not_finite;
  EXPECT_EQ(one.facts().standing, Standing::finished);
}

TEST(PictureNeeds, WithoutVisibleKeypointsAPseudoLabelIsFinished) {
  OneCandidate one;
  one.candidates[0].record.keypoints.fill({128.0, 128.0, 0.0F, 0.0F});
  one.predict(0.0F);
  EXPECT_EQ(one.facts().standing, Standing::finished);
}

TEST(PictureNeeds, TheBandDecidesUntilThereIsAVerdict) {
  EXPECT_EQ(OneCandidate(0.1F).facts().standing, Standing::may_be_kept);
  EXPECT_EQ(OneCandidate(0.5F).facts().standing, Standing::finished);
  OneCandidate middle(0.3F);
  EXPECT_EQ(middle.facts().standing, Standing::to_adapt);
  middle.work.refined.emplace();
  middle.work.judgements.resize(1);
  middle.work.judgements[0].verdict = manifests::Verdict::discarded;
  EXPECT_EQ(middle.facts().standing, Standing::finished);
  middle.work.judgements[0].verdict = manifests::Verdict::refined;
  EXPECT_EQ(middle.facts().standing, Standing::may_be_kept);
}

TEST(PictureNeeds, ARetainedPredictionIsAdaptedOnRequest) {
  OneCandidate low(0.1F);
  low.rules.thresholds["d"].refine_retained = true;
  EXPECT_EQ(low.facts().standing, Standing::to_adapt);
  OneCandidate high(0.5F);
  high.rules.thresholds["d"].refine_retained = true;
  EXPECT_EQ(high.facts().standing, Standing::finished);
}

TEST(PictureNeeds, ARunWithoutRulesNeedsPatchesOnly) {
  OneCandidate one(0.3F);
  EXPECT_EQ(picture_facts(one.work, 0, nullptr).standing, Standing::finished);
  one.work.predicted.reset();
  EXPECT_EQ(parts(picture_facts(one.work, 0, nullptr)), "p");
}

TEST(PictureNeeds, ALabelThatIsNotPredictedNeedsNoPatch) {
  OneCandidate one(0.5F);
  one.candidates[0].role = config::Role::truth;
  EXPECT_EQ(parts(one.facts()), "c") << "no band judges it";
  one.work.predicted.reset();
  EXPECT_EQ(parts(one.facts()), "c");
}

TEST(PictureNeeds, AStoredCropIsEncodedOnceAndForAShardThatIsStillToBeMade) {
  OneCandidate one;
  EXPECT_TRUE(one.facts().lacks_crop);
  one.work.shard_before = true;
  EXPECT_FALSE(one.facts().lacks_crop);
  one.work.shard_before = false;
  one.candidates[0].exclusion.reason = Reason::vetoed;
  EXPECT_FALSE(one.facts().lacks_crop);
  one.candidates[0].exclusion.reason = Reason::none;
  one.work.crops.emplace_back().sample = 1;
  EXPECT_TRUE(one.facts().lacks_crop) << "the crop is another candidate's";
  one.work.crops.front().sample = 0;
  EXPECT_FALSE(one.facts().lacks_crop);
}

TEST(PictureNeeds, PseudoLabelsAreMeasuredOnce) {
  OneCandidate one;
  EXPECT_TRUE(one.facts().measures_label);
  EXPECT_TRUE(one.facts().has_mask);
  one.work.measured.emplace();
  EXPECT_FALSE(one.facts().measures_label);
  one.work.measured.reset();
  one.candidates[0].record.mask_path.clear();
  EXPECT_FALSE(one.facts().has_mask);
  one.candidates[0].role = config::Role::truth;
  EXPECT_FALSE(one.facts().measures_label);
}

}  // namespace
}  // namespace q3d::pipeline::unit
