#include "pipeline/evaluation/tables.h"

#include <gtest/gtest.h>

#include "tests/pipeline/evaluation/made_evaluation.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Family;
using testing::evaluation_of;
using testing::failed;
using testing::sample;

MetricMean metric(const TableRow& row, Metric which) {
  return row.metrics[index_of(which)];
}

TEST(Tables, MeansAreOverTheSamplesThatHaveAValue) {
  Evaluation evaluation =
      evaluation_of({sample("a.jpg#0", Family::felidae, 80.0, 50.0), sample("b.jpg#0", Family::canidae, 60.0),
                     sample("c.jpg#0", Family::none, std::nullopt, 70.0), failed("d.jpg#0")});
  evaluation.datasets[0].samples[1].normalised_by_mask = false;
  const Tables tables = make_tables(evaluation);
  ASSERT_EQ(tables.datasets.size(), 1U);
  const TableRow& row = tables.datasets[0];
  EXPECT_EQ(row.samples, 3);
  EXPECT_EQ(row.by_mask, 2);
  EXPECT_DOUBLE_EQ(*metric(row, Metric::auc).mean, 70.0);
  EXPECT_EQ(metric(row, Metric::auc).samples, 2);
  EXPECT_DOUBLE_EQ(*metric(row, Metric::pa_mpjpe).mean, 60.0);
  EXPECT_FALSE(metric(row, Metric::pa_mpvpe).mean.has_value());

  ASSERT_EQ(tables.families.size(), 3U);
  EXPECT_EQ(tables.families[0].group, "felidae");
  EXPECT_EQ(tables.families[1].group, "canidae");
  EXPECT_EQ(tables.families[2].group, "none");
  EXPECT_DOUBLE_EQ(*metric(tables.families[1], Metric::auc).mean, 60.0);
}

// The official code averages zeros in; only where it measures the metric at all.
TEST(Tables, OfficialMeansCountWhatIsMissingAsZero) {
  Evaluation evaluation =
      evaluation_of({sample("a.jpg#0", Family::felidae, 80.0, 50.0), sample("b.jpg#0", Family::felidae, 60.0),
                     sample("c.jpg#0", Family::felidae, std::nullopt, 70.0)});
  evaluation.options.official_means = true;
  const Tables tables = make_tables(evaluation);
  const TableRow& row = tables.datasets[0];
  EXPECT_NEAR(*metric(row, Metric::auc).mean, 140.0 / 3, 1e-12);
  EXPECT_DOUBLE_EQ(*metric(row, Metric::pa_mpjpe).mean, 40.0);
  EXPECT_FALSE(metric(row, Metric::pa_mpvpe).mean.has_value());
}

TEST(Tables, SpeciesComeByNameAndTheUnknownLast) {
  Evaluation evaluation =
      evaluation_of({sample("a.jpg#0", Family::felidae, 1.0), sample("b.jpg#0", Family::felidae, 2.0),
                     sample("c.jpg#0", Family::felidae, 3.0), sample("d.jpg#0", Family::felidae, 5.0)});
  evaluation.datasets[0].samples[1].species = "tiger";
  evaluation.datasets[0].samples[2].species = "lion";
  evaluation.datasets[0].samples[3].species = "tiger";
  const Tables tables = make_tables(evaluation);
  ASSERT_EQ(tables.species.size(), 3U);
  EXPECT_EQ(tables.species[0].group, "lion");
  EXPECT_EQ(tables.species[1].group, "tiger");
  EXPECT_DOUBLE_EQ(*metric(tables.species[1], Metric::auc).mean, 3.5);
  EXPECT_EQ(tables.species[2].group, "unknown");
}

// Shapes that lie apart by family are found by any k-means; equal shapes say nothing.
TEST(Tables, ClustersOfShapesAreComparedWithFamilies) {
  std::vector<SampleResult> samples;
  for (int i = 0; i < 20; ++i) {
    const auto family = static_cast<Family>(i % 5);
    SampleResult one = sample(std::to_string(i) + ".jpg#0", family, 50.0);
    one.betas[0][static_cast<std::size_t>(i % 5)] = 10.0F + 0.01F * static_cast<float>(i);
    one.true_betas = Betas{};
    (*one.true_betas)[0] = i < 10 ? 1.0F : -1.0F;
    samples.push_back(one);
  }
  samples.push_back(sample("other.jpg#0", Family::none, 50.0));
  const Evaluation evaluation = evaluation_of(samples);
  const Tables tables = make_tables(evaluation);
  ASSERT_EQ(tables.clusters.size(), 2U);
  EXPECT_EQ(tables.clusters[0].samples, 20) << "an animal of no family is left out";
  EXPECT_EQ(tables.clusters[0].families, 5);
  EXPECT_DOUBLE_EQ(*tables.clusters[0].ari, 1.0);
  EXPECT_EQ(tables.clusters[1].setting, nullptr);
  EXPECT_LT(*tables.clusters[1].ari, 0.3);
}

TEST(Tables, FewerSamplesThanClustersHaveNoAri) {
  const Evaluation evaluation = evaluation_of({sample("a.jpg#0", Family::felidae, 1.0)});
  EXPECT_FALSE(make_tables(evaluation).clusters[0].ari.has_value());
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
