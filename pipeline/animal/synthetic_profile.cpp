#include "pipeline/animal/synthetic_profile.h"

#include <algorithm>
#include <cmath>

namespace q3d::pipeline::animal {
namespace {

using Eigen::Vector3d;

// The positions of hips and shoulders on either side of the origin, as fractions of the trunk's length.
constexpr double kHipShare = -0.55;
constexpr double kShoulderShare = 0.45;

Vector3d in_plane(double x, double y) {
  return {x, y, 0.0};
}

// Returns a unit vector at this elevation over +x.
Vector3d direction(double elevation) {
  return in_plane(std::cos(elevation), std::sin(elevation));
}

// Returns that vector, turned upwards by a quarter turn.
Vector3d normal(double elevation) {
  return direction(elevation + M_PI / 2);
}

// A knot of the body's outline.
struct Station {
  double ring;
  Vector3d back, belly;
  double half_width;
  double level;
};

Station across_axis(double ring, const Vector3d& center, double elevation, double depth, double width,
                    double level) {
  const Vector3d up = normal(elevation) * depth / 2;
  return {ring, center + up, center - up, width / 2, level};
}

void add_trunk(const Anatomy& a, std::vector<Station>& stations) {
  const double length = a.trunk_length;
  const auto upright = [&](double ring, double share, double back_y, double depth, double width,
                           double level) {
    stations.push_back(
        {ring, in_plane(share * length, back_y), in_plane(share * length, back_y - depth), width / 2, level});
  };
  const auto back_y = [&](double share) {
    return a.croup_height + (a.withers_height - a.croup_height) * (share - kHipShare);
  };
  upright(5, kHipShare, a.croup_height, a.rump_depth, a.rump_width, 0.0);
  upright(12, -0.28, back_y(-0.28) - 0.7 * a.back_sag, a.loin_depth, a.loin_width, -0.1);
  upright(19, 0.0, back_y(0.0) - a.back_sag, a.belly_depth, a.belly_width, -0.15);
  upright(25, 0.25, back_y(0.25) - 0.5 * a.back_sag, 0.98 * a.chest_depth, a.chest_width, -0.1);
  upright(30, kShoulderShare, a.withers_height, a.chest_depth, 0.88 * a.chest_width, 0.0);
}

void add_neck(const Anatomy& a, std::vector<Station>& stations, Vector3d& poll) {
  // The neck's upper line leaves the withers at a fraction of its slope, which leaves no notch between them.
  const double base_tilt = 0.7 * a.neck_angle;
  const Vector3d withers = in_plane(kShoulderShare * a.trunk_length, a.withers_height);
  const Vector3d base = withers + 0.13 * a.trunk_length * direction(0.45 * a.neck_angle) -
                        0.5 * a.neck_base_depth * normal(base_tilt);
  poll = base + a.neck_length * direction(a.neck_angle);
  stations.push_back(across_axis(34, base, base_tilt, a.neck_base_depth, a.neck_base_width, 0.0));
  stations.push_back(across_axis(38, (base + poll) / 2, a.neck_angle,
                                 0.48 * (a.neck_base_depth + a.neck_top_depth),
                                 0.49 * (a.neck_base_width + a.neck_top_width), 0.0));
  const double poll_tilt = (a.neck_angle - a.head_pitch) / 2;
  stations.push_back(across_axis(42, poll, poll_tilt, a.neck_top_depth, a.neck_top_width, 0.1));
}

// Adds the upper head. In front of the eyes, its lower outline is the mouth line, below which the jaw hangs.
void add_head(const Anatomy& a, const Vector3d& poll, std::vector<Station>& stations) {
  const Vector3d face = direction(-a.head_pitch);
  const Vector3d up = normal(-a.head_pitch);
  const double mouth = -0.20 * a.cranium_depth;
  const auto place = [&](double ring, double share, double top, double bottom, double width, double level) {
    const Vector3d on_axis = poll + share * a.head_length * face;
    stations.push_back({ring, on_axis + top * up, on_axis + bottom * up, width / 2, level});
  };
  const double eyes = 1.0 - a.muzzle_share;
  place(45, 0.55 * eyes, 0.52 * a.cranium_depth, -0.48 * a.cranium_depth, a.cranium_width, 0.15);
  place(48, eyes, mouth + a.eye_depth, mouth, 0.80 * a.cranium_width + 0.1 * a.muzzle_width, 0.1);
  // This knot is close to the corner of the mouth, so that the line turns sharply there and the jaw closes
  // along it.
  place(49, 1.0 - 0.84 * a.muzzle_share, mouth + 0.70 * a.eye_depth + 0.27 * a.muzzle_depth, mouth,
        0.58 * a.cranium_width + 0.36 * a.muzzle_width, -0.35);
  place(51, 1.0 - 0.5 * a.muzzle_share, mouth + a.muzzle_depth, mouth, a.muzzle_width, -0.6);
  place(54, 0.965, mouth + a.nose_depth, mouth + 0.05 * a.nose_depth, a.nose_width, -0.5);
  place(55, 0.99, mouth + 0.85 * a.nose_depth, mouth + 0.25 * a.nose_depth, 0.6 * a.nose_width, -0.3);
}

Eigen::VectorXd channels(const Station& station) {
  Eigen::VectorXd values(6);
  values << station.back.head<2>(), station.belly.head<2>(), station.half_width, station.level;
  return values;
}

BodyRing ring_from(const Eigen::VectorXd& values) {
  return {in_plane(values[0], values[1]), in_plane(values[2], values[3]), values[4], values[5]};
}

// The rings behind the hips close like a quarter of an ellipse.
void close_rump(const Anatomy& a, const Station& hips, BodyProfile& profile) {
  profile.rear_pole = in_plane(hips.back.x() - a.rump_length, a.croup_height - 0.40 * a.rump_depth);
  const Vector3d center = (hips.back + hips.belly) / 2;
  const Vector3d half = (hips.back - hips.belly) / 2;
  for (int ring = 0; ring < hips.ring; ++ring) {
    const double angle = (ring + 1) / (hips.ring + 1) * M_PI / 2;
    const double size = std::pow(std::sin(angle), 0.8);
    const Vector3d middle = profile.rear_pole + (center - profile.rear_pole) * (1.0 - std::cos(angle));
    profile.rings.push_back({middle + size * half, middle - size * half, size * hips.half_width, 0.0});
  }
}

}  // namespace

SmoothCurve::SmoothCurve(std::vector<double> positions, Eigen::MatrixXd values)
    : positions_(std::move(positions)), values_(std::move(values)), slopes_(values_.rows(), values_.cols()) {
  const auto last = static_cast<Eigen::Index>(positions_.size()) - 1;
  const auto step = [this](Eigen::Index i) {
    return positions_[static_cast<std::size_t>(i + 1)] - positions_[static_cast<std::size_t>(i)];
  };
  const auto chord = [&](Eigen::Index i) -> Eigen::RowVectorXd {
    return (values_.row(i + 1) - values_.row(i)) / step(i);
  };
  slopes_.row(0) = chord(0);
  slopes_.row(last) = chord(last - 1);
  for (Eigen::Index i = 1; i < last; ++i) {
    slopes_.row(i) = (chord(i - 1) * step(i) + chord(i) * step(i - 1)) / (step(i - 1) + step(i));
  }
}

Eigen::VectorXd SmoothCurve::at(double position) const {
  const auto above = std::upper_bound(positions_.begin() + 1, positions_.end() - 1, position);
  const auto i = static_cast<Eigen::Index>(above - positions_.begin()) - 1;
  const double start = positions_[static_cast<std::size_t>(i)];
  const double step = positions_[static_cast<std::size_t>(i + 1)] - start;
  const double t = (position - start) / step;
  const double s = 1.0 - t;
  return (s * s * (1.0 + 2.0 * t) * values_.row(i) + t * t * (1.0 + 2.0 * s) * values_.row(i + 1) +
          step * t * s * (s * slopes_.row(i) - t * slopes_.row(i + 1)))
      .transpose();
}

BodyProfile body_profile(const Anatomy& anatomy) {
  std::vector<Station> stations;
  Vector3d poll;
  add_trunk(anatomy, stations);
  add_neck(anatomy, stations, poll);
  add_head(anatomy, poll, stations);

  std::vector<double> positions;
  Eigen::MatrixXd values(static_cast<Eigen::Index>(stations.size()), 6);
  for (const Station& station : stations) {
    values.row(static_cast<Eigen::Index>(positions.size())) = channels(station);
    positions.push_back(station.ring);
  }
  const SmoothCurve outline(positions, values);
  BodyProfile profile;
  close_rump(anatomy, stations.front(), profile);
  for (int ring = static_cast<int>(stations.front().ring); ring < kBodyRings; ++ring) {
    profile.rings.push_back(ring_from(outline.at(ring)));
  }
  const Station& nose = stations.back();
  const Vector3d forward = direction(-anatomy.head_pitch);
  profile.front_pole = (nose.back + nose.belly) / 2 + 0.015 * anatomy.head_length * forward;
  return profile;
}

double ground_height(const Anatomy& a) {
  return a.withers_height - a.chest_depth + 0.03 - a.foreleg_length;
}

}  // namespace q3d::pipeline::animal
