#include "pipeline/animal/synthetic_motion.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace q3d::pipeline::animal {
namespace {

enum Axis { kRoll, kTurn, kPitch };

// The left and middle joints of synthetic_joints(). A left joint stands for both sides.
enum Joint {
  kSpine1 = 1,
  kSpine2,
  kSpine3,
  kSpine4,
  kSpine5,
  kSpine6,
  kShoulder = 7,
  kElbow,
  kCarpus,
  kForeFoot,
  kNeck = 15,
  kHead,
  kHip = 17,
  kStifle,
  kHock,
  kHindFoot,
  kTail1 = 25,
  kTail2,
  kTail3,
  kTail4,
  kTail5,
  kTail6,
  kTail7,
  kJaw,
  kEar
};

// Returns the index offset from a left joint to its right twin, or 0 for a joint in the middle.
int twin_offset(int joint) {
  if (joint == kEar) return 1;
  const bool limb = (joint >= kShoulder && joint <= kForeFoot) || (joint >= kHip && joint <= kHindFoot);
  return limb ? 4 : 0;
}

// One angle of one joint: mean, independent spread and range. The ranges exclude angles that the anatomy
// forbids: elbows and hocks fold forwards only, carpi and stifles backwards only.
struct Angle {
  Joint joint;
  Axis axis;
  double mean, spread, lower, upper;
};

constexpr Angle kAngles[] = {
    {kSpine1, kRoll, 0, 0.02, -0.10, 0.10},      {kSpine1, kTurn, 0, 0.03, -0.20, 0.20},
    {kSpine1, kPitch, 0, 0.02, -0.12, 0.12},     {kSpine2, kRoll, 0, 0.02, -0.10, 0.10},
    {kSpine2, kTurn, 0, 0.03, -0.20, 0.20},      {kSpine2, kPitch, 0, 0.02, -0.12, 0.12},
    {kSpine3, kRoll, 0, 0.02, -0.10, 0.10},      {kSpine3, kTurn, 0, 0.03, -0.20, 0.20},
    {kSpine3, kPitch, 0, 0.02, -0.12, 0.12},     {kSpine4, kRoll, 0, 0.02, -0.10, 0.10},
    {kSpine4, kTurn, 0, 0.03, -0.20, 0.20},      {kSpine4, kPitch, 0, 0.02, -0.12, 0.12},
    {kSpine5, kRoll, 0, 0.02, -0.10, 0.10},      {kSpine5, kTurn, 0, 0.03, -0.20, 0.20},
    {kSpine5, kPitch, 0, 0.02, -0.12, 0.12},     {kSpine6, kRoll, 0, 0.02, -0.10, 0.10},
    {kSpine6, kTurn, 0, 0.03, -0.20, 0.20},      {kSpine6, kPitch, 0, 0.02, -0.12, 0.12},
    {kShoulder, kRoll, 0, 0.06, -0.25, 0.25},    {kShoulder, kTurn, 0, 0.04, -0.15, 0.15},
    {kShoulder, kPitch, 0, 0.12, -0.90, 0.90},   {kElbow, kRoll, 0, 0.02, -0.08, 0.08},
    {kElbow, kTurn, 0, 0.03, -0.10, 0.10},       {kElbow, kPitch, 0.05, 0.12, -0.25, 1.40},
    {kCarpus, kRoll, 0, 0.02, -0.08, 0.08},      {kCarpus, kTurn, 0, 0.03, -0.10, 0.10},
    {kCarpus, kPitch, -0.05, 0.10, -1.40, 0.10}, {kForeFoot, kRoll, 0, 0.03, -0.12, 0.12},
    {kForeFoot, kTurn, 0, 0.04, -0.15, 0.15},    {kForeFoot, kPitch, 0, 0.12, -0.70, 0.50},
    {kNeck, kRoll, 0, 0.05, -0.25, 0.25},        {kNeck, kTurn, 0, 0.10, -0.75, 0.75},
    {kNeck, kPitch, 0, 0.12, -1.00, 0.60},       {kHead, kRoll, 0, 0.08, -0.35, 0.35},
    {kHead, kTurn, 0, 0.10, -0.65, 0.65},        {kHead, kPitch, 0, 0.12, -0.60, 0.55},
    {kHip, kRoll, 0, 0.06, -0.25, 0.25},         {kHip, kTurn, 0, 0.04, -0.15, 0.15},
    {kHip, kPitch, 0, 0.12, -0.75, 0.90},        {kStifle, kRoll, 0, 0.02, -0.08, 0.08},
    {kStifle, kTurn, 0, 0.03, -0.10, 0.10},      {kStifle, kPitch, -0.03, 0.12, -1.10, 0.30},
    {kHock, kRoll, 0, 0.02, -0.08, 0.08},        {kHock, kTurn, 0, 0.03, -0.10, 0.10},
    {kHock, kPitch, 0.03, 0.12, -0.30, 1.10},    {kHindFoot, kRoll, 0, 0.03, -0.12, 0.12},
    {kHindFoot, kTurn, 0, 0.04, -0.15, 0.15},    {kHindFoot, kPitch, 0, 0.12, -0.70, 0.50},
    {kTail1, kRoll, 0, 0.03, -0.15, 0.15},       {kTail1, kTurn, 0, 0.10, -0.60, 0.60},
    {kTail1, kPitch, 0.20, 0.12, -0.70, 0.70},   {kTail2, kRoll, 0, 0.03, -0.15, 0.15},
    {kTail2, kTurn, 0, 0.06, -0.45, 0.45},       {kTail2, kPitch, 0.10, 0.06, -0.45, 0.45},
    {kTail3, kRoll, 0, 0.03, -0.15, 0.15},       {kTail3, kTurn, 0, 0.06, -0.45, 0.45},
    {kTail3, kPitch, 0.05, 0.06, -0.45, 0.45},   {kTail4, kRoll, 0, 0.03, -0.15, 0.15},
    {kTail4, kTurn, 0, 0.06, -0.45, 0.45},       {kTail4, kPitch, 0, 0.06, -0.45, 0.45},
    {kTail5, kRoll, 0, 0.03, -0.15, 0.15},       {kTail5, kTurn, 0, 0.07, -0.45, 0.45},
    {kTail5, kPitch, 0, 0.07, -0.45, 0.45},      {kTail6, kRoll, 0, 0.03, -0.15, 0.15},
    {kTail6, kTurn, 0, 0.08, -0.45, 0.45},       {kTail6, kPitch, 0, 0.08, -0.45, 0.45},
    {kTail7, kRoll, 0, 0.03, -0.15, 0.15},       {kTail7, kTurn, 0, 0.08, -0.45, 0.45},
    {kTail7, kPitch, 0, 0.08, -0.45, 0.45},      {kJaw, kRoll, 0, 0.01, -0.03, 0.03},
    {kJaw, kTurn, 0, 0.01, -0.05, 0.05},         {kJaw, kPitch, -0.06, 0.09, -0.45, 0.0},
    {kEar, kRoll, 0, 0.12, -0.50, 0.50},         {kEar, kTurn, 0, 0.15, -0.60, 0.60},
    {kEar, kPitch, 0, 0.15, -0.60, 0.60}};

// Twins move alike (as mirror images) or against each other, or the joint has no twin.
enum Phase { kAlone, kAlike, kAgainst };

struct Loading {
  Joint joint;
  Axis axis;
  double amount;  // rad per standard deviation of the motion
  Phase phase;
};

// Each motion is one independent standard normal number that moves many joints together.
const std::vector<std::vector<Loading>>& motions() {
  static const std::vector<std::vector<Loading>> kMotions = {
      // Trot: diagonal legs together.
      {{kShoulder, kPitch, 0.26, kAgainst},
       {kElbow, kPitch, 0.16, kAgainst},
       {kCarpus, kPitch, -0.18, kAgainst},
       {kForeFoot, kPitch, -0.10, kAgainst},
       {kHip, kPitch, -0.24, kAgainst},
       {kStifle, kPitch, 0.14, kAgainst},
       {kHock, kPitch, -0.14, kAgainst},
       {kHindFoot, kPitch, 0.08, kAgainst}},
      // Pace: the legs of one side together.
      {{kShoulder, kPitch, 0.16, kAgainst},
       {kElbow, kPitch, 0.10, kAgainst},
       {kCarpus, kPitch, -0.10, kAgainst},
       {kHip, kPitch, 0.16, kAgainst},
       {kStifle, kPitch, -0.08, kAgainst},
       {kHock, kPitch, 0.08, kAgainst}},
      // Lifted leg in front, lifted leg behind: the phase of the gait at which legs fold.
      {{kShoulder, kPitch, 0.10, kAgainst},
       {kElbow, kPitch, 0.22, kAgainst},
       {kCarpus, kPitch, -0.30, kAgainst}},
      {{kHip, kPitch, 0.12, kAgainst}, {kStifle, kPitch, -0.22, kAgainst}, {kHock, kPitch, 0.22, kAgainst}},
      // Gallop: forelegs reach out while hind legs push, the back stretches; and the reverse.
      {{kShoulder, kPitch, 0.22, kAlike},
       {kHip, kPitch, -0.22, kAlike},
       {kStifle, kPitch, 0.10, kAlike},
       {kHock, kPitch, -0.08, kAlike},
       {kSpine1, kPitch, 0.015, kAlone},
       {kSpine2, kPitch, 0.02, kAlone},
       {kSpine3, kPitch, 0.02, kAlone},
       {kSpine4, kPitch, 0.015, kAlone}},
      // Crouch towards lying down, front and behind.
      {{kShoulder, kPitch, -0.16, kAlike}, {kElbow, kPitch, 0.30, kAlike}, {kCarpus, kPitch, -0.22, kAlike}},
      {{kHip, kPitch, 0.18, kAlike}, {kStifle, kPitch, -0.30, kAlike}, {kHock, kPitch, 0.26, kAlike}},
      // Graze with one sign, look up with the other.
      {{kNeck, kPitch, -0.34, kAlone},
       {kHead, kPitch, -0.12, kAlone},
       {kSpine6, kPitch, -0.04, kAlone},
       {kSpine5, kPitch, -0.03, kAlone}},
      // Nod.
      {{kNeck, kPitch, 0.10, kAlone}, {kHead, kPitch, -0.18, kAlone}},
      // Look to the side.
      {{kNeck, kTurn, 0.24, kAlone}, {kHead, kTurn, 0.20, kAlone}, {kSpine6, kTurn, 0.03, kAlone}},
      // Bend the back to the side, the tail with it.
      {{kSpine1, kTurn, 0.04, kAlone},
       {kSpine2, kTurn, 0.05, kAlone},
       {kSpine3, kTurn, 0.05, kAlone},
       {kSpine4, kTurn, 0.05, kAlone},
       {kSpine5, kTurn, 0.05, kAlone},
       {kNeck, kTurn, 0.08, kAlone},
       {kTail1, kTurn, -0.08, kAlone}},
      // Swing, lift and curl the tail. It points backwards, so lifting is negative.
      {{kTail1, kTurn, 0.18, kAlone},
       {kTail2, kTurn, 0.12, kAlone},
       {kTail3, kTurn, 0.10, kAlone},
       {kTail4, kTurn, 0.08, kAlone},
       {kTail5, kTurn, 0.06, kAlone}},
      {{kTail1, kPitch, -0.24, kAlone}, {kTail2, kPitch, -0.10, kAlone}, {kTail3, kPitch, -0.06, kAlone}},
      {{kTail3, kPitch, -0.06, kAlone},
       {kTail4, kPitch, -0.10, kAlone},
       {kTail5, kPitch, -0.12, kAlone},
       {kTail6, kPitch, -0.12, kAlone},
       {kTail7, kPitch, -0.12, kAlone}},
      // Ears forwards and back.
      {{kEar, kPitch, 0.20, kAlike}, {kEar, kTurn, 0.12, kAlike}}};
  return kMotions;
}

Eigen::Index component(int joint, Axis axis) {
  return 3 * joint + axis;
}

// Returns the angle of the mirror image, which has the same pitch and the opposite roll and turn.
double mirrored(Axis axis, double angle) {
  return axis == kPitch ? angle : -angle;
}

}  // namespace

MotionModel synthetic_motion() {
  MotionModel model;
  for (Eigen::VectorXd* part : {&model.mean, &model.spread, &model.lower, &model.upper})
    *part = Eigen::VectorXd::Zero(kPoseSize);
  for (const Angle& angle : kAngles) {
    for (const int offset : {0, twin_offset(angle.joint)}) {
      const Eigen::Index at = component(angle.joint + offset, angle.axis);
      const bool flip = offset != 0 && angle.axis != kPitch;
      model.mean[at] = flip ? -angle.mean : angle.mean;
      model.spread[at] = angle.spread;
      model.lower[at] = flip ? -angle.upper : angle.lower;
      model.upper[at] = flip ? -angle.lower : angle.upper;
    }
  }
  model.loadings = Eigen::MatrixXd::Zero(kPoseSize, static_cast<Eigen::Index>(motions().size()));
  for (std::size_t motion = 0; motion < motions().size(); ++motion) {
    const auto column = static_cast<Eigen::Index>(motion);
    for (const Loading& load : motions()[motion]) {
      model.loadings(component(load.joint, load.axis), column) = load.amount;
      if (load.phase == kAlone) continue;
      const double twin = mirrored(load.axis, load.amount) * (load.phase == kAgainst ? -1.0 : 1.0);
      model.loadings(component(load.joint + twin_offset(load.joint), load.axis), column) = twin;
    }
  }
  return model;
}

Eigen::VectorXd bounded_normals(Eigen::Index count, std::mt19937_64& random) {
  constexpr double kBound = 2.5;
  // This is Box and Muller's transform, because std::normal_distribution differs between libraries.
  const auto uniform = [&random] { return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53; };
  Eigen::VectorXd numbers(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    numbers[i] = std::clamp(radius * std::cos(2.0 * M_PI * uniform()), -kBound, kBound);
  }
  return numbers;
}

Eigen::VectorXd sample_motion(const MotionModel& model, std::mt19937_64& random) {
  const Eigen::VectorXd motion = bounded_normals(model.loadings.cols(), random);
  const Eigen::VectorXd noise = bounded_normals(kPoseSize, random);
  const Eigen::VectorXd pose = model.mean + model.loadings * motion + model.spread.cwiseProduct(noise);
  return pose.cwiseMax(model.lower).cwiseMin(model.upper);
}

}  // namespace q3d::pipeline::animal
