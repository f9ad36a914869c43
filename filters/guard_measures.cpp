#include "filters/guard_measures.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "manifests/sample.h"

namespace q3d::filters {
namespace {

constexpr std::size_t kJoints = manifests::kNumJoints;
constexpr std::size_t kKeypoints = manifests::kNumKeypoints;
constexpr std::size_t kPoseNumbers = 3 * kJoints;
constexpr std::uint8_t kInside = 128;

// SMAL's joints: 0 is the root at the hips, 1 to 6 run along the spine to the withers; each leg is a chain of
// four joints.
constexpr std::size_t kWithers = 6;
constexpr std::array<std::size_t, 4> kLegs{7, 11, 17, 21};
constexpr std::size_t kBonesOfLeg = 3;

void require_count(const char* function, const char* what, std::size_t got, std::size_t expected) {
  if (got == expected) return;
  throw std::invalid_argument(std::string(function) + ": " + what + ": got " + std::to_string(got) +
                              ", expected " + std::to_string(expected));
}

double distance(std::span<const float> joints, std::size_t a, std::size_t b) {
  double sum = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double difference = double{joints[3 * a + axis]} - joints[3 * b + axis];
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

}  // namespace

double pose_deviation(std::span<const float> rotations, const PosePrior& prior) {
  require_count("pose_deviation", "rotations", rotations.size(), kJoints * 9);
  require_count("pose_deviation", "the prior's mean", prior.mean.size(), kPoseNumbers);
  require_count("pose_deviation", "the prior's precs", prior.precs.size(), kPoseNumbers * kPoseNumbers);
  require_count("pose_deviation", "the prior's use", prior.use.size(), kPoseNumbers);
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using Vector = Eigen::VectorXd;
  Vector pose(kPoseNumbers);
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> matrix(&rotations[9 * joint]);
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(matrix.cast<double>()));
    pose.segment<3>(static_cast<Eigen::Index>(3 * joint)) = turn.angle() * turn.axis();
  }
  const auto size = static_cast<Eigen::Index>(kPoseNumbers);
  const Eigen::Map<const Vector> mean(prior.mean.data(), size);
  const Eigen::Map<const Vector> use(prior.use.data(), size);
  const Eigen::Map<const Matrix> precs(prior.precs.data(), size, size);
  const double used = use.sum();
  if (!(used > 0.0)) throw std::invalid_argument("pose_deviation: the prior uses none of its numbers");
  const Vector whitened = (precs.transpose() * (pose - mean)).cwiseProduct(use);
  return std::sqrt(whitened.squaredNorm() / used);
}

double shape_deviation(std::span<const float> betas, int family, const ShapePrior& prior) {
  constexpr std::size_t kBetas = manifests::kNumBetas;
  require_count("shape_deviation", "betas", betas.size(), kBetas);
  const auto families = static_cast<int>(prior.families.size());
  if (families == 0 || family < -1 || family >= families) {
    throw std::invalid_argument("shape_deviation: got the family " + std::to_string(family) + " of " +
                                std::to_string(families));
  }
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto size = static_cast<Eigen::Index>(kBetas);
  const Eigen::VectorXd given = Eigen::Map<const Eigen::VectorXf>(betas.data(), size).cast<double>();
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < families; ++i) {
    if (family >= 0 && i != family) continue;
    const ShapePrior::Family& own = prior.families[static_cast<std::size_t>(i)];
    require_count("shape_deviation", "the prior's mean", own.mean.size(), kBetas);
    require_count("shape_deviation", "the prior's precs", own.precs.size(), kBetas * kBetas);
    const Eigen::Map<const Eigen::VectorXd> mean(own.mean.data(), size);
    const Eigen::Map<const Matrix> precs(own.precs.data(), size, size);
    const Eigen::VectorXd whitened = precs.transpose() * (given - mean);
    least = std::min(least, std::sqrt(whitened.squaredNorm() / static_cast<double>(kBetas)));
  }
  return least;
}

std::vector<float> mirrored_keypoints(std::span<const float> keypoints, std::span<const int> mirror) {
  require_count("mirrored_keypoints", "numbers of the keypoints", keypoints.size(), kKeypoints * 3);
  require_count("mirrored_keypoints", "mirror images", mirror.size(), kKeypoints);
  std::vector<float> mirrored(keypoints.size());
  for (std::size_t k = 0; k < kKeypoints; ++k) {
    const auto other = static_cast<std::size_t>(mirror[k]);
    mirrored[3 * k] = -keypoints[3 * other];
    mirrored[3 * k + 1] = keypoints[3 * other + 1];
    mirrored[3 * k + 2] = keypoints[3 * other + 2];
  }
  return mirrored;
}

double mean_absolute_difference(std::span<const float> a, std::span<const float> b) {
  require_count("mean_absolute_difference", "numbers", b.size(), a.size());
  if (a.empty()) throw std::invalid_argument("mean_absolute_difference: got no numbers");
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(double{a[i]} - b[i]);
  return sum / static_cast<double>(a.size());
}

std::array<double, 12> relative_limb_lengths(std::span<const float> joints) {
  require_count("relative_limb_lengths", "numbers of the joints", joints.size(), kJoints * 3);
  double spine = 0.0;
  for (std::size_t joint = 0; joint < kWithers; ++joint) spine += distance(joints, joint, joint + 1);
  std::array<double, 12> lengths{};
  std::size_t limb = 0;
  for (const std::size_t first : kLegs) {
    for (std::size_t bone = 0; bone < kBonesOfLeg; ++bone) {
      lengths[limb++] = distance(joints, first + bone, first + bone + 1) / spine;
    }
  }
  return lengths;
}

LimbRange limb_range(std::span<const std::array<double, 12>> bodies) {
  if (bodies.empty()) throw std::invalid_argument("limb_range: got no bodies");
  LimbRange range{bodies.front(), bodies.front()};
  for (const auto& body : bodies) {
    for (std::size_t limb = 0; limb < body.size(); ++limb) {
      if (!(body[limb] > 0.0 && std::isfinite(body[limb]))) {
        throw std::invalid_argument("limb_range: got a limb of length " + std::to_string(body[limb]) +
                                    ", expected finite lengths above 0");
      }
      range.least[limb] = std::min(range.least[limb], body[limb]);
      range.most[limb] = std::max(range.most[limb], body[limb]);
    }
  }
  return range;
}

double limb_factor(const std::array<double, 12>& lengths, const LimbRange& range) {
  double worst = 0.0;
  for (std::size_t limb = 0; limb < lengths.size(); ++limb) {
    if (!std::isfinite(lengths[limb])) return std::numeric_limits<double>::infinity();
    worst = std::max({worst, lengths[limb] / range.most[limb], range.least[limb] / lengths[limb]});
  }
  return worst;
}

double left_right_ratio(const smal::CropPoints& projected, const smal::CropKeypoints& annotated,
                        std::span<const int> mirror) {
  require_count("left_right_ratio", "mirror images", mirror.size(), kKeypoints);
  double as_annotated = 0.0;
  double exchanged = 0.0;
  bool has_pair = false;
  for (std::size_t k = 0; k < kKeypoints; ++k) {
    const auto other = static_cast<std::size_t>(mirror[k]);
    if (other == k || !annotated[k].is_visible() || !annotated[other].is_visible()) continue;
    has_pair = true;
    as_annotated += std::abs(double{projected[k].x} - annotated[k].x);
    as_annotated += std::abs(double{projected[k].y} - annotated[k].y);
    exchanged += std::abs(double{projected[k].x} - annotated[other].x);
    exchanged += std::abs(double{projected[k].y} - annotated[other].y);
  }
  if (!has_pair) return std::numeric_limits<double>::quiet_NaN();
  if (as_annotated == exchanged) return 1.0;  // also 0 / 0: the sides coincide
  return as_annotated / exchanged;
}

double mask_iou(std::span<const std::uint8_t> one, std::span<const std::uint8_t> other) {
  require_count("mask_iou", "pixels", other.size(), one.size());
  std::int64_t both = 0;
  std::int64_t either = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    const bool in_one = one[i] >= kInside;
    const bool in_other = other[i] >= kInside;
    both += in_one && in_other ? 1 : 0;
    either += in_one || in_other ? 1 : 0;
  }
  if (either == 0) return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(both) / static_cast<double>(either);
}

}  // namespace q3d::filters
