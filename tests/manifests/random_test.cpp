#include "manifests/random.h"

#include <gtest/gtest.h>

#include <array>

namespace q3d::manifests {
namespace {

// The standard fixes the engine: the 10000th number of a default-constructed one is 9981545732273789042.
TEST(Uniform, TakesTheTopBitsOfTheEngine) {
  std::mt19937_64 engine;
  engine.discard(9999);
  EXPECT_DOUBLE_EQ(uniform(engine), 9981545732273789042.0 / 18446744073709551616.0);
}

TEST(Uniform, WholeNumbersAreBelowTheCountAndEachOccursAsOften) {
  std::mt19937_64 engine(1);
  std::array<int, 7> seen{};
  for (int i = 0; i < 70'000; ++i) ++seen.at(uniform_below(engine, seen.size()));
  // Five standard deviations of a binomial number: sqrt(70000 / 7 * 6 / 7) is 93.
  for (const int count : seen) EXPECT_NEAR(count, 10'000, 465);
}

// The first numbers of the reference implementation (prng.di.unimi.it/splitmix64.c) for the seed 1234567.
TEST(Rng, GivesTheNumbersOfSplitMix64) {
  Rng rng(1234567);
  EXPECT_EQ(rng.next(), 6457827717110365317ULL);
  EXPECT_EQ(rng.next(), 3203168211198807973ULL);
  EXPECT_EQ(rng.next(), 9817491932198370423ULL);
}

}  // namespace
}  // namespace q3d::manifests
