// Properties that every affine map has.
//
// Entries are at most 4 and shifts at most 1000 px; maps whose determinant is below 1/16 are left out. The
// inverse's entries are then at most 64 and its shifts at most 1.3e5 px, so that a dozen roundings of 1e-16
// relative stay below 2e-10 px.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "loaders/pictures/affine.h"
#include "tests/support/properties.h"

namespace q3d::loaders::pictures {
namespace {

using testing::number_between;

constexpr double kTolerancePx = 2e-10;
constexpr double kLeastDeterminant = 1.0 / 16.0;

Affine any_map() {
  const auto entry = number_between(-4, 4);
  const auto shift = number_between(-1000, 1000);
  return {*entry, *entry, *shift, *entry, *entry, *shift};
}

double determinant(const Affine& map) {
  return map[0] * map[4] - map[1] * map[3];
}

Affine invertible_map() {
  const Affine map = any_map();
  RC_PRE(std::abs(determinant(map)) >= kLeastDeterminant);
  return map;
}

Point any_point() {
  return {*number_between(-2000, 2000), *number_between(-2000, 2000)};
}

void assert_close(Point got, Point expected, double tolerance_px = kTolerancePx) {
  RC_ASSERT(std::abs(got.x - expected.x) <= tolerance_px);
  RC_ASSERT(std::abs(got.y - expected.y) <= tolerance_px);
}

RC_GTEST_PROP(AffineProperties, MapsStraightLinesToStraightLines, ()) {
  const Affine map = any_map();
  const Point a = any_point();
  const Point b = any_point();
  const Point from = map_point(map, a);
  const Point to = map_point(map, b);
  assert_close(map_point(map, {(a.x + b.x) / 2, (a.y + b.y) / 2}),
               {(from.x + to.x) / 2, (from.y + to.y) / 2});
}

RC_GTEST_PROP(AffineProperties, MovesTheOriginToTheShift, ()) {
  const Affine map = any_map();
  const Point moved = map_point(map, {0.0, 0.0});
  RC_ASSERT(moved.x == map[2]);
  RC_ASSERT(moved.y == map[5]);
}

RC_GTEST_PROP(AffineProperties, AComposedMapIsTheSecondAfterTheFirst, ()) {
  const Affine first = any_map();
  const Affine second = any_map();
  const Point point = any_point();
  assert_close(map_point(compose(second, first), point), map_point(second, map_point(first, point)));
}

RC_GTEST_PROP(AffineProperties, CompositionIsAssociative, ()) {
  const Affine a = any_map();
  const Affine b = any_map();
  const Affine c = any_map();
  const Point point = any_point();
  assert_close(map_point(compose(compose(c, b), a), point), map_point(compose(c, compose(b, a)), point));
}

RC_GTEST_PROP(AffineProperties, TheInverseTakesEveryPointBack, ()) {
  const Affine map = invertible_map();
  const Point point = any_point();
  assert_close(map_point(invert(map), map_point(map, point)), point);
  assert_close(map_point(compose(invert(map), map), point), point);
}

RC_GTEST_PROP(AffineProperties, TheInverseOfAProductIsTheProductOfInversesTurnedRound, ()) {
  const Affine first = invertible_map();
  const Affine second = invertible_map();
  const Point point = any_point();
  const Point image = map_point(second, map_point(first, point));
  // The inverse maps' entries reach 4 / determinant each, and the image lies up to some 7e4 px away: rounding
  // is up to 7e4 * 32 * 2.2e-16 px over both determinants, and a few operations more.
  const double bound_px = 5e-9 / std::abs(determinant(first) * determinant(second));
  assert_close(map_point(compose(invert(first), invert(second)), image), point,
               std::max(kTolerancePx, bound_px));
}

// The second row is a multiple of the first by a power of two, so that the determinant is exactly zero.
RC_GTEST_PROP(AffineProperties, AFlatMapHasNoInverse, ()) {
  Affine map = any_map();
  const double multiple = *rc::gen::element(-2.0, -1.0, 0.0, 0.5, 1.0, 4.0);
  map[3] = multiple * map[0];
  map[4] = multiple * map[1];
  RC_ASSERT_THROWS_AS(invert(map), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::loaders::pictures
