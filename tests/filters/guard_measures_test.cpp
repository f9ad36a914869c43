// Numbers worked out by hand.
#include "filters/guard_measures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace q3d::filters {
namespace {

constexpr std::size_t kPoseNumbers = 105;

std::vector<float> identity_rotations() {
  std::vector<float> rotations(35 * 9, 0.0F);
  for (std::size_t joint = 0; joint < 35; ++joint) {
    for (std::size_t axis = 0; axis < 3; ++axis) rotations[9 * joint + 4 * axis] = 1.0F;
  }
  return rotations;
}

// Turns a joint by `angle` rad about z.
void turn_about_z(std::vector<float>& rotations, std::size_t joint, double angle) {
  const auto c = static_cast<float>(std::cos(angle));
  const auto s = static_cast<float>(std::sin(angle));
  const std::array<float, 9> matrix{c, -s, 0, s, c, 0, 0, 0, 1};
  std::copy(matrix.begin(), matrix.end(), rotations.begin() + static_cast<std::ptrdiff_t>(9 * joint));
}

PosePrior unit_prior() {
  PosePrior prior{std::vector<double>(kPoseNumbers, 0.0),
                  std::vector<double>(kPoseNumbers * kPoseNumbers, 0.0),
                  std::vector<double>(kPoseNumbers, 1.0)};
  for (std::size_t i = 0; i < kPoseNumbers; ++i) prior.precs[i * kPoseNumbers + i] = 1.0;
  std::fill_n(prior.use.begin(), 3, 0.0);
  return prior;
}

TEST(PoseDeviation, IsTheRootMeanSquareOfTheWhitenedPose) {
  std::vector<float> rotations = identity_rotations();
  const PosePrior prior = unit_prior();
  EXPECT_NEAR(pose_deviation(rotations, prior), 0.0, 1e-9);
  turn_about_z(rotations, 4, 0.6);
  EXPECT_NEAR(pose_deviation(rotations, prior), 0.6 / std::sqrt(102.0), 1e-6);
  turn_about_z(rotations, 0, 3.0);
  EXPECT_NEAR(pose_deviation(rotations, prior), 0.6 / std::sqrt(102.0), 1e-6)
      << "the global orientation is no part of it";
}

TEST(PoseDeviation, MultipliesFromTheLeftAndTakesTheMeanAway) {
  std::vector<float> rotations = identity_rotations();
  turn_about_z(rotations, 4, 0.6);
  PosePrior prior = unit_prior();
  const std::size_t z_of_4 = 14;
  const std::size_t x_of_9 = 27;
  prior.mean[z_of_4] = 0.1;
  // A row feeds two columns: deviation 0.5 becomes 2 * 0.5 in column 14 and 3 * 0.5 in column 27.
  prior.precs[z_of_4 * kPoseNumbers + z_of_4] = 2.0;
  prior.precs[z_of_4 * kPoseNumbers + x_of_9] = 3.0;
  EXPECT_NEAR(pose_deviation(rotations, prior), std::sqrt((1.0 + 2.25) / 102.0), 1e-6);
  prior.use[x_of_9] = 0.0;
  EXPECT_NEAR(pose_deviation(rotations, prior), std::sqrt(1.0 / 101.0), 1e-6);
}

TEST(PoseDeviation, RefusesWrongCounts) {
  PosePrior prior = unit_prior();
  EXPECT_THROW(pose_deviation(std::vector<float>(9), prior), std::invalid_argument);
  prior.use.assign(kPoseNumbers, 0.0);
  EXPECT_THROW(pose_deviation(identity_rotations(), prior), std::invalid_argument);
  prior.use.pop_back();
  EXPECT_THROW(pose_deviation(identity_rotations(), prior), std::invalid_argument);
}

// A spine along x in steps of 0.5 (length 3) and four straight legs with bones of the given lengths.
std::vector<float> animal(const std::array<float, 3>& bones) {
  std::vector<float> joints(35 * 3, 0.0F);
  for (std::size_t joint = 0; joint <= 6; ++joint) joints[3 * joint] = 0.5F * static_cast<float>(joint);
  for (const std::size_t first : {7, 11, 17, 21}) {
    float y = 0.0F;
    for (std::size_t bone = 0; bone < 3; ++bone) {
      y -= bones[bone];
      joints[3 * (first + bone + 1) + 1] = y;
    }
  }
  return joints;
}

TEST(LimbLengths, AreRelativeToTheSpine) {
  const auto lengths = relative_limb_lengths(animal({0.75F, 1.5F, 0.375F}));
  for (std::size_t leg = 0; leg < 4; ++leg) {
    EXPECT_DOUBLE_EQ(lengths[3 * leg], 0.25);
    EXPECT_DOUBLE_EQ(lengths[3 * leg + 1], 0.5);
    EXPECT_DOUBLE_EQ(lengths[3 * leg + 2], 0.125);
  }
  EXPECT_THROW(relative_limb_lengths(std::vector<float>(26 * 3)), std::invalid_argument);
}

TEST(LimbFactor, IsThatOfTheWorstLimb) {
  std::array<double, 12> small{}, large{};
  small.fill(0.2);
  large.fill(0.4);
  const LimbRange range = limb_range(std::vector{large, small});
  std::array<double, 12> limbs{};
  limbs.fill(0.3);
  EXPECT_DOUBLE_EQ(limb_factor(limbs, range), 0.75) << "0.3 / 0.4, and 0.2 / 0.3 is less";
  limbs[5] = 0.6;
  EXPECT_DOUBLE_EQ(limb_factor(limbs, range), 1.5);
  limbs[7] = 0.1;
  EXPECT_DOUBLE_EQ(limb_factor(limbs, range), 2.0);
  limbs[0] = 0.0;
  EXPECT_TRUE(std::isinf(limb_factor(limbs, range)));
  limbs[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isinf(limb_factor(limbs, range)));
  EXPECT_THROW(limb_range({}), std::invalid_argument);
  EXPECT_THROW(limb_range(std::vector{limbs}), std::invalid_argument);
}

// Keypoints 0 and 1 mirror each other, and 2 and 3; the others themselves.
std::array<int, 26> mirror() {
  std::array<int, 26> flip{};
  std::iota(flip.begin(), flip.end(), 0);
  std::swap(flip[0], flip[1]);
  std::swap(flip[2], flip[3]);
  return flip;
}

struct Sample {
  smal::CropPoints projected{};
  smal::CropKeypoints annotated{};
  void place(std::size_t k, float projected_x, float annotated_x, float weight = 1.0F) {
    projected[k].x = projected_x;
    annotated[k] = {annotated_x, 0.0F, weight};
  }
  double ratio() const { return left_right_ratio(projected, annotated, mirror()); }
};

TEST(LeftRight, ComparesTheErrorWithThatOfExchangedSides) {
  Sample sample;
  sample.place(0, 0.125F, 0.0F);
  sample.place(1, 0.5F, 0.5F);
  // As annotated 0.125 + 0; exchanged |0.125 - 0.5| + |0.5 - 0|.
  EXPECT_DOUBLE_EQ(sample.ratio(), 0.125 / 0.875);
  std::swap(sample.projected[0], sample.projected[1]);
  EXPECT_DOUBLE_EQ(sample.ratio(), 7.0);
}

TEST(LeftRight, LooksAtPairsOfWhichBothAreVisible) {
  Sample sample;
  sample.place(7, 9.0F, 0.0F);  // in the middle of the body
  sample.place(2, 9.0F, 0.0F);
  sample.place(3, 9.0F, 0.0F, 0.0F);
  EXPECT_TRUE(std::isnan(sample.ratio()));
  sample.place(0, 0.25F, 0.25F);
  sample.place(1, 0.25F, 0.25F);
  EXPECT_DOUBLE_EQ(sample.ratio(), 1.0) << "the sides coincide";
  sample.place(0, 0.5F, 0.25F);
  sample.place(1, 0.25F, 0.5F);
  EXPECT_TRUE(std::isinf(sample.ratio())) << "perfect with the sides exchanged";
}

TEST(MaskIou, CountsPixelsOfHalfAndMore) {
  const std::vector<std::uint8_t> one{255, 255, 255, 0, 0, 127};
  const std::vector<std::uint8_t> other{0, 128, 255, 255, 0, 0};
  EXPECT_DOUBLE_EQ(mask_iou(one, other), 0.5);
  EXPECT_DOUBLE_EQ(mask_iou(one, one), 1.0);
  EXPECT_TRUE(std::isnan(mask_iou(std::vector<std::uint8_t>(4), std::vector<std::uint8_t>(4))));
  EXPECT_THROW(mask_iou(one, std::vector<std::uint8_t>(4)), std::invalid_argument);
}

// Two families in 41 dimensions: of unit variance around 0, and of half the deviation around 10 in beta 0.
ShapePrior two_families() {
  constexpr std::size_t kBetas = 41;
  ShapePrior prior;
  for (const double scale : {1.0, 2.0}) {
    ShapePrior::Family& family = prior.families.emplace_back();
    family.mean.assign(kBetas, 0.0);
    family.precs.assign(kBetas * kBetas, 0.0);
    for (std::size_t i = 0; i < kBetas; ++i) family.precs[i * kBetas + i] = scale;
  }
  prior.families[1].mean[0] = 10.0;
  return prior;
}

TEST(ShapeDeviation, IsTheWhitenedRootMeanSquare) {
  std::vector<float> betas(41, 0.0F);
  betas[0] = 8.0F;
  EXPECT_DOUBLE_EQ(shape_deviation(betas, 0, two_families()), 8.0 / std::sqrt(41.0));
  EXPECT_DOUBLE_EQ(shape_deviation(betas, 1, two_families()), 4.0 / std::sqrt(41.0));
  EXPECT_DOUBLE_EQ(shape_deviation(betas, -1, two_families()), 4.0 / std::sqrt(41.0)) << "the nearest";
  // precs acts from the right: deviation @ precs.
  ShapePrior skewed = two_families();
  skewed.families[0].precs[0 * 41 + 1] = 3.0;
  EXPECT_DOUBLE_EQ(shape_deviation(betas, 0, skewed), std::sqrt((8.0 * 8.0 + 24.0 * 24.0) / 41.0));
  EXPECT_THROW(shape_deviation(betas, 2, two_families()), std::invalid_argument);
  EXPECT_THROW(shape_deviation(std::vector<float>(40), 0, two_families()), std::invalid_argument);
  EXPECT_THROW(shape_deviation(betas, -1, {}), std::invalid_argument);
}

TEST(MirroredKeypoints, ChangeSideAndPlace) {
  std::vector<float> keypoints(26 * 3);
  for (std::size_t i = 0; i < keypoints.size(); ++i) keypoints[i] = static_cast<float>(i);
  std::vector<int> mirror(26);
  for (int k = 0; k < 26; ++k) mirror[static_cast<std::size_t>(k)] = k;
  mirror[0] = 1;
  mirror[1] = 0;
  const std::vector<float> mirrored = mirrored_keypoints(keypoints, mirror);
  EXPECT_EQ(std::vector(mirrored.begin(), mirrored.begin() + 9),
            (std::vector<float>{-3, 4, 5, 0, 1, 2, -6, 7, 8}));
  EXPECT_EQ(mirrored_keypoints(mirrored, mirror), keypoints) << "twice is nothing";
  EXPECT_THROW(mirrored_keypoints(std::vector<float>(77), mirror), std::invalid_argument);
}

TEST(MeanAbsoluteDifference, IsOverAllNumbers) {
  EXPECT_EQ(mean_absolute_difference(std::vector<float>{1, 2, -3}, std::vector<float>{1, 0, 1}), 2.0);
  EXPECT_THROW(mean_absolute_difference({}, {}), std::invalid_argument);
  EXPECT_THROW(mean_absolute_difference(std::vector<float>{1}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::filters
