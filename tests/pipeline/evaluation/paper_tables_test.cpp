// The paper's tables: where an evaluation's numbers stand in them.
#include "pipeline/evaluation/paper_tables.h"

#include <gmock/gmock.h>

#include "tests/pipeline/evaluation/made_evaluation.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Family;
using testing::evaluation_of;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::sample;

Evaluation animal3d() {
  Evaluation evaluation = evaluation_of(
      {sample("a.jpg#0", Family::felidae, 80.0, 50.0), sample("b.jpg#0", Family::equidae, 61.0, 71.0)});
  evaluation.datasets[0].name = "animal3d/test";
  evaluation.settings.push_back({"TTA 30", true, 30, 1.0});
  for (SampleResult& each : evaluation.datasets[0].samples) {
    each.values.push_back(each.values[0]);
    each.values[1][index_of(Metric::pa_mpjpe)] = 40.0;
    each.betas.emplace_back();
  }
  return evaluation;
}

TEST(PaperTables, OurNumbersStandUnderThePapers) {
  const Evaluation evaluation = animal3d();
  const std::string text = paper_tables(make_tables(evaluation), false);
  EXPECT_THAT(text, HasSubstr("| PRIMA, Stage 3 | 89.9 | 74.7 | 79.4 | 94.2 | 40.1 | 42.7 |\n"
                              "| this evaluation | 70.5 | 60.5 | - | - | - | - |\n"));
  // Equidae first, Felidae third; no PA-MPVPE.
  EXPECT_THAT(text, HasSubstr("| this evaluation | 71.0 | - | - | - | 50.0 | - | - | - | - | - |\n"));
  EXPECT_THAT(text, HasSubstr("| PRIMA, Stage 1 | 75.3 | 71.7 | 79.5 | 75.9 | 89.6 | 91.5 |\n"
                              "| this evaluation | 60.5 | 40.0 | - | - | 70.5 | 70.5 |\n"));
  EXPECT_THAT(text, Not(HasSubstr("rendered")));
}

TEST(PaperTables, RenderedPicturesAreNotCompared) {
  const Evaluation evaluation = animal3d();
  EXPECT_THAT(paper_tables(make_tables(evaluation), true), HasSubstr("may be compared across.**"));
}

TEST(PaperTables, Quadruped2dIsAPartOfSuperAnimal) {
  Evaluation evaluation = evaluation_of({sample("a.jpg#0", Family::felidae, 83.0)});
  evaluation.datasets[0].name = "quadruped2d/test";
  EXPECT_THAT(paper_tables(make_tables(evaluation), false),
              HasSubstr("| this evaluation | 83.0 | - | - | - | - | - |\n"));
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
