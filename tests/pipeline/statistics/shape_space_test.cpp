#include "pipeline/statistics/shape_space.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/pipeline/statistics/made_facts.h"

namespace q3d::pipeline::statistics {
namespace {

using smal::Betas;

// Points in the plane of two directions that are orthogonal to each other: 3 u along one, v along the other.
std::vector<Betas> plane() {
  std::vector<Betas> points;
  for (int u = -2; u <= 2; ++u) {
    for (int v = -2; v <= 2; ++v) {
      Betas& betas = points.emplace_back();
      betas.fill(7.0F);
      betas[3] += 3.0F * static_cast<float>(u) * 0.6F - static_cast<float>(v) * 0.8F;
      betas[9] += 3.0F * static_cast<float>(u) * 0.8F + static_cast<float>(v) * 0.6F;
    }
  }
  return points;
}

TEST(PrincipalComponentsOf, FindsThePlaneThatThePointsLieIn) {
  const PrincipalComponents components = principal_components(plane());
  EXPECT_NEAR(components.explained[0], 0.9, 1e-6) << "9 of 9 + 1";
  EXPECT_NEAR(components.explained[1], 0.1, 1e-6);
  std::size_t i = 0;
  for (int u = -2; u <= 2; ++u) {
    for (int v = -2; v <= 2; ++v, ++i) {
      EXPECT_NEAR(components.scores[i][0], 3.0 * u, 1e-5);
      // The second direction is (-0.8, 0.6): its largest component is made positive.
      EXPECT_NEAR(components.scores[i][1], -1.0 * v, 1e-5);
    }
  }
  EXPECT_THROW(principal_components({Betas{}, Betas{}}), std::invalid_argument);
}

TEST(ShapeSpace, FamiliesThatLieApartAgreeWithTheClusters) {
  Facts facts;
  for (int i = 0; i < 100; ++i) {
    const int family = i % 5;
    CandidateFacts& each =
        facts.candidates.emplace_back(candidate({.family = static_cast<manifests::Family>(family)}));
    Betas betas{};
    betas[static_cast<std::size_t>(family)] = 10.0F;
    betas[20] = 0.1F * std::sin(static_cast<float>(i));
    each.betas = betas;
  }
  facts.candidates.push_back(candidate({.family = manifests::Family::none}));
  facts.candidates.back().betas = Betas{};
  const auto shape = shape_space(facts, 40);
  EXPECT_EQ(shape["labels"], 101);
  EXPECT_EQ(shape["shown"], 40);
  EXPECT_EQ(shape["x"].size(), 40U);
  EXPECT_EQ(shape["ari"]["value"], 1.0);
  EXPECT_EQ(shape["ari"]["labels"], 100) << "those of known family";
}

TEST(ShapeSpace, SaysNothingOfOneFamily) {
  Facts facts;
  for (int i = 0; i < 10; ++i) {
    CandidateFacts& each = facts.candidates.emplace_back(candidate({}));
    Betas betas{};
    betas[0] = static_cast<float>(i);
    each.betas = betas;
  }
  EXPECT_TRUE(shape_space(facts)["ari"].is_null());
  facts.candidates.resize(2);
  EXPECT_TRUE(shape_space(facts).is_null());
}

}  // namespace
}  // namespace q3d::pipeline::statistics
