#include "pipeline/evaluation/compare.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::evaluation {
namespace {

// One dataset and one setting; AUC and PA-MPJPE of each picture by functions of its number.
template <typename Auc, typename Pa>
StoredEvaluation stored(int pictures, const Auc& auc, const Pa& pa) {
  StoredEvaluation evaluation;
  evaluation.folder = "some/where";
  evaluation.setting_names = {"prediction"};
  evaluation.dataset_names = {"d/test"};
  StoredDataset& dataset = evaluation.datasets["d/test"];
  dataset.annotations_sha256 = "a";
  for (int i = 0; i < pictures; ++i) {
    StoredSample sample{"d/test/" + std::to_string(i) + ".jpg#0", "mask", {}};
    sample.values[index_of(Metric::auc)] = auc(i);
    sample.values[index_of(Metric::pa_mpjpe)] = pa(i);
    dataset.settings["prediction"].push_back(sample);
  }
  return evaluation;
}

double wave(int i) {
  return i % 2 == 0 ? 1.0 : -1.0;
}

StoredEvaluation plain(int pictures = 100) {
  return stored(
      pictures, [](int i) { return 50.0 + i; }, [](int i) { return 100.0 + i; });
}

const ComparisonRow& row(const Comparison& comparison, Metric metric) {
  for (const ComparisonRow& each : comparison.rows) {
    if (each.metric == metric) return each;
  }
  throw std::logic_error("no such row");
}

TEST(Compare, DirectionDependsOnTheMetric) {
  const StoredEvaluation after = stored(
      100, [](int i) { return 51.0 + i + wave(i); }, [](int i) { return 101.0 + i + wave(i); });
  const Comparison comparison = compare({plain()}, {after}, {});
  ASSERT_EQ(comparison.rows.size(), 2U) << "metrics that no sample has are left out";
  const ComparisonRow& auc = row(comparison, Metric::auc);
  EXPECT_EQ(auc.samples, 100);
  EXPECT_EQ(auc.pictures, 100);
  EXPECT_DOUBLE_EQ(auc.before, 99.5);
  EXPECT_DOUBLE_EQ(auc.after, 100.5);
  EXPECT_DOUBLE_EQ(auc.difference.mean, 1.0);
  EXPECT_NEAR(auc.difference.low, 1.0 - 1.96 / 10, 0.02);
  EXPECT_EQ(auc.finding, Finding::better);
  EXPECT_EQ(row(comparison, Metric::pa_mpjpe).finding, Finding::worse) << "a larger error is worse";
  const Comparison reverse = compare({after}, {plain()}, {});
  EXPECT_EQ(row(reverse, Metric::auc).finding, Finding::worse);
  EXPECT_EQ(row(reverse, Metric::pa_mpjpe).finding, Finding::better);
}

TEST(Compare, AnIntervalAroundZeroShowsNothing) {
  const StoredEvaluation after = stored(
      100, [](int i) { return 50.05 + i + wave(i); }, [](int i) { return 100.0 + i; });
  const Comparison comparison = compare({plain()}, {after}, {});
  EXPECT_EQ(row(comparison, Metric::auc).finding, Finding::no_difference_shown);
  EXPECT_EQ(row(comparison, Metric::pa_mpjpe).finding, Finding::no_difference_shown) << "equal throughout";
}

// Each seed alone is clear; together they disagree.
TEST(Compare, SeedsThatDisagreeWidenTheInterval) {
  const auto shifted = [](double by) {
    return stored(
        100, [by](int i) { return 50.0 + i + by; }, [](int i) { return 100.0 + i; });
  };
  EXPECT_EQ(row(compare({plain()}, {shifted(3.0)}, {}), Metric::auc).finding, Finding::better);
  const Comparison both = compare({plain(), plain()}, {shifted(3.0), shifted(-2.0)}, {});
  const ComparisonRow& auc = row(both, Metric::auc);
  EXPECT_DOUBLE_EQ(auc.difference.mean, 0.5);
  EXPECT_DOUBLE_EQ(auc.difference.low, -2.0);
  EXPECT_DOUBLE_EQ(auc.difference.high, 3.0);
  EXPECT_EQ(auc.finding, Finding::no_difference_shown);
}

TEST(Compare, SamplesWithoutAPartnerAreCounted) {
  StoredEvaluation after = plain(90);
  after.datasets["d/test"].settings["prediction"][0].values[index_of(Metric::auc)].reset();
  const Comparison comparison = compare({plain()}, {after}, {});
  EXPECT_EQ(row(comparison, Metric::auc).samples, 89);
  EXPECT_EQ(row(comparison, Metric::auc).unpaired, 11);
  EXPECT_EQ(row(comparison, Metric::pa_mpjpe).unpaired, 10);
}

TEST(Compare, AnimalsOfAPictureCountAsOne) {
  StoredEvaluation before = plain(10);
  for (StoredSample& sample : before.datasets["d/test"].settings["prediction"]) {
    sample.id = "d/test/one.jpg#" + sample.id;
  }
  EXPECT_EQ(row(compare({before}, {before}, {}), Metric::auc).pictures, 10);
  int number = 0;
  for (StoredSample& sample : before.datasets["d/test"].settings["prediction"]) {
    sample.id = "d/test/one.jpg#" + std::to_string(number++);
  }
  EXPECT_EQ(row(compare({before}, {before}, {}), Metric::auc).pictures, 1);
}

TEST(Compare, SettingsCanBeSetAgainstEachOther) {
  StoredEvaluation evaluation = plain();
  StoredDataset& dataset = evaluation.datasets["d/test"];
  evaluation.setting_names.push_back("TTA 30");
  dataset.settings["TTA 30"] = dataset.settings["prediction"];
  for (StoredSample& sample : dataset.settings["TTA 30"]) *sample.values[index_of(Metric::auc)] += 2.0;
  CompareOptions options;
  options.before_setting = "prediction";
  options.after_setting = "TTA 30";
  EXPECT_DOUBLE_EQ(row(compare({evaluation}, {evaluation}, options), Metric::auc).difference.mean, 2.0);
  const Comparison common = compare({plain()}, {evaluation}, {});
  EXPECT_EQ(row(common, Metric::auc).after_setting, "prediction");
  options.after_setting = "TTA 31";
  EXPECT_THROW(compare({evaluation}, {evaluation}, options), std::invalid_argument);
  options.after_setting.clear();
  EXPECT_THROW(compare({evaluation}, {evaluation}, options), std::invalid_argument);
}

TEST(Compare, RefusesWhatCannotBePaired) {
  EXPECT_THROW(compare({}, {}, {}), std::invalid_argument);
  EXPECT_THROW(compare({plain(), plain()}, {plain()}, {}), std::invalid_argument);
  StoredEvaluation other_labels = plain();
  other_labels.datasets["d/test"].annotations_sha256 = "b";
  EXPECT_THROW(compare({plain()}, {other_labels}, {}), std::runtime_error);
  StoredEvaluation other_truth = plain();
  other_truth.datasets["d/test"].truth_sha256 = "t";
  EXPECT_THROW(compare({plain()}, {other_truth}, {}), std::runtime_error);
  StoredEvaluation other_scale = plain();
  other_scale.datasets["d/test"].settings["prediction"][5].normaliser = "crop";
  EXPECT_THROW(compare({plain()}, {other_scale}, {}), std::runtime_error);
  StoredEvaluation elsewhere = plain();
  elsewhere.dataset_names = {"e/test"};
  elsewhere.datasets = {{"e/test", StoredDataset{}}};
  EXPECT_THROW(compare({plain()}, {elsewhere}, {}), std::runtime_error);
}

TEST(Compare, TheSummarySaysWhatWasFound) {
  const StoredEvaluation after = stored(
      100, [](int i) { return 51.0 + i + wave(i); }, [](int i) { return 100.0 + i; });
  const std::string text = summary_text(compare({plain()}, {after}, {}));
  EXPECT_NE(text.find("better"), std::string::npos) << text;
  EXPECT_NE(text.find("no difference shown"), std::string::npos) << text;
  EXPECT_NE(text.find("+1.00"), std::string::npos) << text;
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
