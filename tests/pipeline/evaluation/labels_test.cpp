#include "pipeline/evaluation/labels.h"

#include <gtest/gtest.h>

#include "manifests/csv.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Reason;
using manifests::Verdict;

MeasuredCandidate candidate(const std::string& id, Verdict verdict, Reason reason, double before,
                            std::optional<double> label) {
  MeasuredCandidate measured;
  measured.id = id;
  measured.verdict = verdict;
  measured.reason = reason;
  measured.predicted.annotated[index_of(Metric::pa_mpjpe)] = before;
  measured.predicted.projected[index_of(Metric::auc)] = before / 2;
  if (label) {
    measured.label.emplace();
    measured.label->annotated[index_of(Metric::pa_mpjpe)] = label;
  }
  return measured;
}

std::vector<MeasuredCandidate> pool() {
  return {candidate("a", Verdict::retained, Reason::none, 20.0, 20.0),
          candidate("b", Verdict::refined, Reason::none, 60.0, 40.0),
          candidate("c", Verdict::discarded, Reason::gain_too_small, 80.0, std::nullopt),
          candidate("d", Verdict::discarded, Reason::error_too_large, 120.0, std::nullopt)};
}

TEST(GroupLabels, EachGroupHasItsOwnMean) {
  struct Expected {
    const char* group;
    const char* bodies;
    std::int64_t samples;
    double pa_mpjpe;
  };
  const std::vector<Expected> expected{{"pool", "prediction", 4, 70.0},
                                       {"kept", "label", 2, 30.0},
                                       {"kept", "prediction", 2, 40.0},
                                       {"retained", "label", 1, 20.0},
                                       {"refined", "label", 1, 40.0},
                                       {"refined", "prediction", 1, 60.0},
                                       {"discarded", "prediction", 2, 100.0},
                                       {"discarded: error_too_large", "prediction", 1, 120.0},
                                       {"discarded: gain_too_small", "prediction", 1, 80.0}};
  const std::vector<LabelRow> rows = group_labels(pool());
  ASSERT_EQ(rows.size(), expected.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].group, expected[i].group);
    EXPECT_EQ(rows[i].bodies, expected[i].bodies);
    EXPECT_EQ(rows[i].samples, expected[i].samples);
    EXPECT_DOUBLE_EQ(*rows[i].annotated[index_of(Metric::pa_mpjpe)].mean, expected[i].pa_mpjpe);
  }
  EXPECT_DOUBLE_EQ(*rows[0].projected[index_of(Metric::auc)].mean, 35.0);
}

TEST(GroupLabels, GroupsThatDoNotOccurHaveNoRow) {
  EXPECT_TRUE(group_labels({}).empty());
  const std::vector<LabelRow> rows =
      group_labels({candidate("a", Verdict::retained, Reason::none, 20.0, 20.0)});
  ASSERT_EQ(rows.size(), 4U);  // pool, kept twice, retained
}

TEST(LabelsCsv, HasALineACandidate) {
  LabelEvaluation evaluation;
  evaluation.candidates = pool();
  const std::string text = labels_csv(evaluation);
  manifests::CsvReader reader(text, "labels.csv");
  std::vector<manifests::CsvRow> rows;
  for (manifests::CsvRow row; reader.next(row);) rows.push_back(row);
  ASSERT_EQ(rows.size(), 5U);
  EXPECT_EQ(rows[4][0], "d");
  EXPECT_EQ(rows[4][1], "discarded");
  EXPECT_EQ(rows[4][2], "error_too_large");
  const auto column = std::find(rows[0].begin(), rows[0].end(), "label_pa_mpjpe_mm") - rows[0].begin();
  ASSERT_LT(column, static_cast<std::ptrdiff_t>(rows[0].size()));
  EXPECT_EQ(rows[2][static_cast<std::size_t>(column)], "40");
  EXPECT_EQ(rows[4][static_cast<std::size_t>(column)], "");
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
