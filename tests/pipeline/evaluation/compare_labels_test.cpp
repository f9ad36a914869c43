// Two builds over a pool of six candidates, worked out by hand.
#include "pipeline/evaluation/compare_labels.h"

#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "pipeline/evaluation/labels.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::evaluation {
namespace {

StoredLabel label(const std::string& picture, double l_proj, std::optional<double> pa_mpjpe) {
  StoredLabel stored;
  stored.id = "d/train/" + picture + "#0";
  stored.kept = true;
  stored.values[index_of(Metric::l_proj)] = l_proj;
  stored.values[index_of(Metric::pa_mpjpe)] = pa_mpjpe;
  if (pa_mpjpe) stored.values[index_of(Metric::pa_mpvpe)] = 2.0 * *pa_mpjpe;
  return stored;
}

StoredLabel discarded(const std::string& picture) {
  StoredLabel stored;
  stored.id = "d/train/" + picture + "#0";
  return stored;
}

StoredLabels build(std::vector<StoredLabel> candidates) {
  StoredLabels labels;
  labels.folder = "folder";
  labels.truth_sha256 = {"t"};
  labels.candidates = std::move(candidates);
  return labels;
}

// Keeps a, b, c, d; of these c has the largest L_proj, then b and d are equal.
StoredLabels paper() {
  return build({label("a", 0.1, 10.0), label("b", 0.2, 20.0), label("c", 0.3, 90.0), label("d", 0.2, 30.0),
                discarded("e"), discarded("f")});
}

// Keeps b, better than before, and e.
StoredLabels strict() {
  return build({discarded("a"), label("b", 0.25, 16.0), discarded("c"), discarded("d"), label("e", 0.1, 12.0),
                discarded("f")});
}

const LabelComparisonRow& row_of(const LabelComparison& comparison, const std::string& group, Metric metric) {
  for (const LabelComparisonRow& row : comparison.rows) {
    if (row.group == group && row.metric == metric) return row;
  }
  throw std::runtime_error("no row " + group);
}

TEST(CompareLabels, CutsTheLargerSetToTheSmallerOne) {
  const LabelComparison comparison = compare_labels({paper()}, {strict()}, {});
  ASSERT_EQ(comparison.pairs.size(), 1U);
  EXPECT_EQ(comparison.pairs[0].candidates, 6);
  EXPECT_EQ(comparison.pairs[0].kept_before, 4);
  EXPECT_EQ(comparison.pairs[0].kept_after, 2);
  EXPECT_EQ(comparison.pairs[0].equal, 2);
  EXPECT_EQ(comparison.pairs[0].both, 1);
  const LabelComparisonRow& equal = row_of(comparison, "equal yield", Metric::pa_mpjpe);
  EXPECT_EQ(equal.samples_before, 2);
  EXPECT_DOUBLE_EQ(equal.before, 15.0) << "a and b: d has b's L_proj and a later id";
  EXPECT_DOUBLE_EQ(equal.after, 14.0);
  EXPECT_DOUBLE_EQ(equal.difference.mean, -1.0);
  const LabelComparisonRow& both = row_of(comparison, "kept by both", Metric::pa_mpvpe);
  EXPECT_DOUBLE_EQ(both.before, 40.0);
  EXPECT_DOUBLE_EQ(both.after, 32.0);
  EXPECT_DOUBLE_EQ(both.difference.low, -8.0) << "one picture leaves no doubt";
  EXPECT_EQ(both.finding, Finding::better);
  EXPECT_DOUBLE_EQ(row_of(comparison, "all kept", Metric::pa_mpjpe).before, 37.5);
}

TEST(CompareLabels, CutsEitherSide) {
  const LabelComparison comparison = compare_labels({strict()}, {paper()}, {});
  EXPECT_DOUBLE_EQ(row_of(comparison, "equal yield", Metric::pa_mpjpe).difference.mean, 1.0);
  EXPECT_EQ(row_of(comparison, "kept by both", Metric::pa_mpvpe).finding, Finding::worse);
}

TEST(CompareLabels, SeveralPairsAreOneComparison) {
  StoredLabels other_paper = build({label("a", 0.1, 40.0), label("z", 0.2, 60.0)});
  StoredLabels other_strict = build({label("a", 0.1, 40.0), discarded("z")});
  const LabelComparison comparison = compare_labels({paper(), other_paper}, {strict(), other_strict}, {});
  EXPECT_EQ(comparison.pairs[1].equal, 1);
  const LabelComparisonRow& equal = row_of(comparison, "equal yield", Metric::pa_mpjpe);
  EXPECT_EQ(equal.samples_before, 3);
  EXPECT_DOUBLE_EQ(equal.before, 70.0 / 3.0);
  EXPECT_DOUBLE_EQ(equal.after, 68.0 / 3.0);
}

TEST(CompareLabels, KeptLabelsWithoutATruthCountForTheYieldAlone) {
  StoredLabels before = build({label("a", 0.1, std::nullopt), label("b", 0.2, 20.0), label("c", 0.3, 30.0)});
  StoredLabels after = build({discarded("a"), label("b", 0.2, 20.0), label("c", 0.3, 30.0)});
  const LabelComparison comparison = compare_labels({before}, {after}, {});
  EXPECT_EQ(comparison.pairs[0].equal, 2);
  EXPECT_EQ(row_of(comparison, "equal yield", Metric::pa_mpjpe).samples_before, 1);
  StoredLabels blind = build({label("a", 0.1, std::nullopt)});
  EXPECT_THROW(compare_labels({blind}, {blind}, {}), std::runtime_error);
}

TEST(CompareLabels, RefusesWhatDoesNotBelongTogether) {
  EXPECT_THROW(compare_labels({}, {}, {}), std::invalid_argument);
  EXPECT_THROW(compare_labels({paper()}, {strict(), strict()}, {}), std::invalid_argument);
  StoredLabels other = strict();
  other.truth_sha256 = {"u"};
  EXPECT_THROW(compare_labels({paper()}, {other}, {}), std::runtime_error);
  other = strict();
  other.candidates.pop_back();
  EXPECT_THROW(compare_labels({paper()}, {other}, {}), std::runtime_error);
  other.candidates.push_back(discarded("g"));
  EXPECT_THROW(compare_labels({paper()}, {other}, {}), std::runtime_error);
}

TEST(LabelFiles, ReadWhatEvaluateLabelsWrites) {
  const testing::ScratchDir scratch;
  LabelEvaluation evaluation;
  evaluation.dataset = "v-123";
  evaluation.content_id = "c";
  evaluation.truth_sha256 = {"t"};
  evaluation.candidates.resize(2);
  MeasuredCandidate& kept = evaluation.candidates[0];
  kept.id = "d/train/a, or b#0";
  kept.verdict = manifests::Verdict::refined;
  kept.label.emplace();
  kept.label->annotated[index_of(Metric::l_proj)] = 0.125;
  kept.label->annotated[index_of(Metric::pa_mpvpe)] = 33.5;
  MeasuredCandidate& left_out = evaluation.candidates[1];
  left_out.id = "d/train/c#0";
  left_out.verdict = manifests::Verdict::discarded;
  left_out.reason = manifests::Reason::mask_mismatch;
  write_label_evaluation(scratch.path(), evaluation);
  const StoredLabels labels = read_label_evaluation(scratch.path());
  EXPECT_EQ(labels.dataset, "v-123");
  EXPECT_EQ(labels.truth_sha256, evaluation.truth_sha256);
  ASSERT_EQ(labels.candidates.size(), 2U);
  EXPECT_EQ(labels.candidates[0].id, kept.id);
  EXPECT_TRUE(labels.candidates[0].kept);
  EXPECT_EQ(labels.candidates[0].values[index_of(Metric::l_proj)], 0.125);
  EXPECT_EQ(labels.candidates[0].values[index_of(Metric::pa_mpvpe)], 33.5);
  EXPECT_FALSE(labels.candidates[0].values[index_of(Metric::pa_mpjpe)]);
  EXPECT_FALSE(labels.candidates[1].kept);
  std::ofstream(scratch.path() / "labels.json") << "{}";
  try {
    read_label_evaluation(scratch.path());
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("labels.json"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
