#include "pipeline/world/stance.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "pipeline/animal/synthetic_motion.h"

namespace q3d::pipeline::world {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// SMAL's joints. A leg is four joints from the body outwards, left before right.
constexpr int kNeck = 15;
constexpr int kForeLegs[] = {7, 11};
constexpr int kHindLegs[] = {17, 21};
constexpr int kLegJoints = 4;

bool is_leg(int joint) {
  return (joint >= 7 && joint < 15) || (joint >= 17 && joint < 25);
}

// At rest all joints share the body's axes (x to the head, y up, z to the right), so that a positive turn
// about z swings a leg forwards and lifts the head, one about y turns the head to the left, one about x leans
// to the right.
class Posing {
 public:
  Posing(Stance& stance, manifests::Rng& rng) : stance_(stance), rng_(rng) {}

  void turn(int joint, int axis, double degrees) {
    stance_.pose[static_cast<std::size_t>(3 * joint + axis)] += static_cast<float>(degrees * kDegree);
  }
  void bend(int joint, double degrees) { turn(joint, 2, degrees); }
  double about(double mean, double deviation) { return rng_.normal(mean, deviation); }

  // Turns one leg's joints by the given degrees about z, each with a random deviation.
  void leg(int first, const double (&degrees)[kLegJoints], double deviation) {
    for (int i = 0; i < kLegJoints; ++i) bend(first + i, about(degrees[i], deviation));
  }

  // Adds a pose of the prior, with its distance from the mean scaled, and with the legs only if `legs` is
  // true.
  void add_motion(double spread, bool legs);

 private:
  Stance& stance_;
  manifests::Rng& rng_;
};

void Posing::add_motion(double spread, bool legs) {
  static const animal::MotionModel kModel = animal::synthetic_motion();
  std::mt19937_64 random(rng_.next());
  Eigen::VectorXd pose = kModel.mean + spread * (animal::sample_motion(kModel, random) - kModel.mean);
  pose = pose.cwiseMax(kModel.lower).cwiseMin(kModel.upper);
  for (int joint = 1; joint < smal::kNumJoints; ++joint) {
    if (is_leg(joint) && !legs) continue;
    for (int axis = 0; axis < 3; ++axis) turn(joint, axis, pose[3 * joint + axis] / kDegree);
  }
}

void sit(Stance& stance, Posing& posing) {
  const double up = std::clamp(posing.about(34.0, 6.0), 15.0, 50.0);
  stance.pitch = up * kDegree;
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {-up, 0.0, 0.0, 0.0}, 4.0);
    posing.leg(kHindLegs[side], {58.0, -88.0, 62.0, -20.0}, 6.0);
    posing.turn(kHindLegs[side], 0, side == 0 ? 9.0 : -9.0);
  }
  posing.bend(kNeck, -0.5 * up);
}

void lie(Posing& posing) {
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {-48.0, 118.0, -10.0, -10.0}, 7.0);
    posing.leg(kHindLegs[side], {66.0, -116.0, 96.0, -20.0}, 7.0);
    posing.turn(kHindLegs[side], 0, side == 0 ? 12.0 : -12.0);
  }
  posing.bend(kNeck, posing.about(8.0, 10.0));
}

void rear(Stance& stance, Posing& posing) {
  const double up = std::clamp(posing.about(48.0, 10.0), 25.0, 70.0);
  stance.pitch = up * kDegree;
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {posing.about(15.0, 15.0), 40.0, -60.0, -20.0}, 8.0);
    posing.leg(kHindLegs[side], {-0.75 * up, -10.0, 15.0, 0.0}, 6.0);
  }
  posing.bend(kNeck, -0.4 * up);
}

void leap(Stance& stance, Posing& posing, manifests::Rng& rng) {
  stance.pitch = posing.about(8.0, 12.0) * kDegree;
  stance.lift = rng.uniform(0.1, 0.5);
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {48.0, 10.0, -20.0, -10.0}, 9.0);
    posing.leg(kHindLegs[side], {-46.0, 6.0, 10.0, 0.0}, 9.0);
  }
}

void roll_over(Stance& stance, Posing& posing, manifests::Rng& rng) {
  stance.roll = (rng.chance(0.5) ? 1.0 : -1.0) * rng.uniform(65.0, 150.0) * kDegree;
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {posing.about(5.0, 18.0), 30.0, -45.0, -10.0}, 12.0);
    posing.leg(kHindLegs[side], {posing.about(20.0, 18.0), -45.0, 35.0, 0.0}, 12.0);
  }
}

void bow(Stance& stance, Posing& posing) {
  const double down = std::clamp(posing.about(24.0, 5.0), 10.0, 36.0);
  stance.pitch = -down * kDegree;
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {40.0 + down, 25.0, 0.0, 0.0}, 5.0);
    posing.leg(kHindLegs[side], {down, 0.0, 0.0, 0.0}, 4.0);
  }
  posing.bend(kNeck, 0.8 * down);
}

void extreme(Stance& stance, Posing& posing, manifests::Rng& rng) {
  switch (rng.below(4)) {
    case 0:
      return rear(stance, posing);
    case 1:
      return leap(stance, posing, rng);
    case 2:
      return roll_over(stance, posing, rng);
    default:
      return bow(stance, posing);
  }
}

}  // namespace

Stance draw_stance(const StanceHabits& habits, manifests::Rng& rng) {
  constexpr double kCalm = 0.6;  // a resting or straining animal's back, neck and tail move less
  Stance stance;
  Posing posing(stance, rng);
  const double kind = rng.uniform();
  if (kind < habits.extreme) {
    extreme(stance, posing, rng);
  } else if (kind < habits.extreme + 0.5 * habits.resting) {
    sit(stance, posing);
  } else if (kind < habits.extreme + habits.resting) {
    lie(posing);
  }
  const bool ordinary = kind >= habits.extreme + habits.resting;
  posing.add_motion(ordinary ? habits.spread : kCalm, ordinary);
  stance.pitch += rng.normal(0.0, 2.0) * kDegree;
  stance.roll += rng.normal(0.0, 1.5) * kDegree;
  return stance;
}

}  // namespace q3d::pipeline::world
