#include "pipeline/world/stance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace q3d::pipeline::world {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// SMAL's joints. A leg is four joints from the body outwards.
constexpr int kSpineFirst = 1, kSpineLast = 6, kNeck = 15, kHead = 16, kTailFirst = 25, kTailLast = 31, kJaw = 32,
              kLeftEar = 33, kRightEar = 34;
constexpr int kForeLegs[] = {7, 11};   // left, right
constexpr int kHindLegs[] = {17, 21};
constexpr int kLegJoints = 4;

// At rest all joints share the body's axes (x to the head, y up, z to the right), so that a positive turn about z
// swings a leg forwards and lifts the head, one about y turns the head to the left, one about x leans to the
// right.
class Posing {
 public:
  Posing(Stance& stance, const StanceHabits& habits, Rng& rng)
      : stance_(stance), spread_(habits.spread), rng_(rng) {}

  void turn(int joint, int axis, double degrees) {
    stance_.pose[static_cast<std::size_t>(3 * joint + axis)] += static_cast<float>(degrees * kDegree);
  }
  void bend(int joint, double degrees) { turn(joint, 2, degrees); }
  double about(double mean, double deviation) { return rng_.normal(mean, deviation * spread_); }

  // One leg's joints in turn, degrees about z, each a little off.
  void leg(int first, const double (&degrees)[kLegJoints], double deviation) {
    for (int i = 0; i < kLegJoints; ++i) bend(first + i, about(degrees[i], deviation));
  }

  // A step: `phase` runs over one stride, `reach` is the swing of the upper leg.
  void fore_step(int side, double phase, double reach) {
    const double lifted = std::max(0.0, std::cos(phase));  // while the leg moves forwards
    leg(kForeLegs[side], {reach * std::sin(phase), 0.9 * reach * lifted, -1.6 * reach * lifted, -0.6 * reach * lifted},
        4.0);
  }
  void hind_step(int side, double phase, double reach) {
    const double lifted = std::max(0.0, std::cos(phase));
    leg(kHindLegs[side], {reach * std::sin(phase) + 0.4 * reach * lifted, -1.4 * reach * lifted,
                          1.2 * reach * lifted, -0.6 * reach * lifted},
        4.0);
  }

  void gait(double reach, bool bounding);
  void loosen();

 private:
  Stance& stance_;
  double spread_;
  Rng& rng_;
};

void Posing::gait(double reach, bool bounding) {
  const double phase = rng_.uniform(0.0, 2.0 * std::numbers::pi);
  // Walking and trotting move diagonal legs together; bounding moves the pairs.
  const double pair = bounding ? rng_.uniform(0.1, 0.5) : std::numbers::pi;
  const double hind = bounding ? std::numbers::pi * rng_.uniform(0.7, 1.3) : std::numbers::pi;
  fore_step(0, phase, reach);
  fore_step(1, phase + pair, reach);
  hind_step(0, phase + hind, reach);
  hind_step(1, phase + hind + pair, reach);
  if (!bounding) return;
  for (int joint = kSpineFirst; joint <= kSpineLast; ++joint) bend(joint, about(3.0 * std::sin(phase), 1.0));
  stance_.lift = std::max(0.0, rng_.normal(0.02, 0.05));
}

// What every living animal adds: a turned head, a bent spine, legs not quite parallel, a moving tail and ears.
void Posing::loosen() {
  for (int joint = kSpineFirst; joint <= kSpineLast; ++joint) {
    turn(joint, 1, about(0.0, 3.0));
    bend(joint, about(0.0, 1.5));
    turn(joint, 0, about(0.0, 1.0));
  }
  const double look = about(0.0, 16.0);
  turn(kNeck, 1, 0.6 * look);
  turn(kHead, 1, 0.6 * look + about(0.0, 8.0));
  bend(kNeck, about(0.0, 9.0));
  bend(kHead, about(0.0, 9.0));
  turn(kHead, 0, about(0.0, 6.0));
  for (int side = 0; side < 2; ++side) {
    turn(kForeLegs[side], 0, about(0.0, 3.5));
    turn(kHindLegs[side], 0, about(0.0, 3.5));
  }
  const double raised = about(0.0, 7.0), wag = about(0.0, 9.0);
  for (int joint = kTailFirst; joint <= kTailLast; ++joint) {
    bend(joint, 0.6 * raised + about(0.0, 4.0));
    turn(joint, 1, 0.6 * wag + about(0.0, 4.0));
  }
  if (rng_.chance(0.3)) bend(kJaw, -std::abs(about(0.0, 12.0)));
  const double ears = about(0.0, 12.0);
  turn(kLeftEar, 0, ears + about(0.0, 5.0));
  turn(kRightEar, 0, -ears + about(0.0, 5.0));
}

void head_down(Posing& posing) {
  posing.bend(5, posing.about(-7.0, 3.0));
  posing.bend(6, posing.about(-9.0, 3.0));
  posing.bend(kNeck, posing.about(-42.0, 10.0));
  posing.bend(kHead, posing.about(-8.0, 10.0));
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

void leap(Stance& stance, Posing& posing, Rng& rng) {
  stance.pitch = posing.about(8.0, 12.0) * kDegree;
  stance.lift = rng.uniform(0.1, 0.5);
  for (int side = 0; side < 2; ++side) {
    posing.leg(kForeLegs[side], {48.0, 10.0, -20.0, -10.0}, 9.0);
    posing.leg(kHindLegs[side], {-46.0, 6.0, 10.0, 0.0}, 9.0);
  }
}

void roll_over(Stance& stance, Posing& posing, Rng& rng) {
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

void extreme(Stance& stance, Posing& posing, Rng& rng) {
  switch (rng.below(4)) {
    case 0: return rear(stance, posing);
    case 1: return leap(stance, posing, rng);
    case 2: return roll_over(stance, posing, rng);
    default: return bow(stance, posing);
  }
}

}  // namespace

Stance draw_stance(const StanceHabits& habits, Rng& rng) {
  Stance stance;
  Posing posing(stance, habits, rng);
  const double kind = rng.uniform();
  if (kind < habits.extreme) {
    extreme(stance, posing, rng);
  } else if (kind < habits.extreme + 0.5 * habits.resting) {
    sit(stance, posing);
  } else if (kind < habits.extreme + habits.resting) {
    lie(posing);
  } else {
    const double pace = rng.uniform();
    if (pace < 0.35) posing.gait(posing.about(6.0, 2.0), false);        // standing
    else if (pace < 0.75) posing.gait(posing.about(20.0, 4.0), false);  // walking, trotting
    else posing.gait(posing.about(34.0, 6.0), rng.chance(0.6));         // running
    if (pace < 0.6 && rng.chance(0.25)) head_down(posing);
  }
  posing.loosen();
  stance.pitch += rng.normal(0.0, 2.0) * kDegree;
  stance.roll += rng.normal(0.0, 1.5) * kDegree;
  return stance;
}

}  // namespace q3d::pipeline::world
