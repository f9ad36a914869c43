#include "pipeline/world/coat.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace q3d::pipeline::world {
namespace {

// SMAL's joints by body part. The synthetic quadruped has the same tree as the official asset.
struct JointRange {
  int first, last;
};
constexpr JointRange kLegs[] = {{8, 10}, {12, 14}, {18, 20}, {22, 24}};
constexpr JointRange kFeet[] = {{10, 10}, {14, 14}, {20, 20}, {24, 24}};
constexpr JointRange kTail[] = {{25, 31}};
constexpr JointRange kTailTip[] = {{29, 31}};
constexpr JointRange kHead[] = {{16, 16}, {32, 34}};
constexpr JointRange kEars[] = {{33, 34}};
constexpr JointRange kNeck[] = {{15, 15}};

// The keypoints that have their own colour.
enum Keypoint { left_eye = 0, right_eye = 1, left_mouth = 22, right_mouth = 23, nose = 24 };

template <std::size_t N>
float share(const std::array<float, smal::kNumJoints>& skinning, const JointRange (&parts)[N]) {
  float sum = 0.0F;
  for (const JointRange& part : parts) {
    for (int joint = part.first; joint <= part.last; ++joint)
      sum += skinning[static_cast<std::size_t>(joint)];
  }
  return sum;
}

std::vector<Eigen::Vector3f> rest_normals(const RestMesh& rest) {
  std::vector<Eigen::Vector3f> normals(rest.vertices.size(), Eigen::Vector3f::Zero());
  for (const render::Triangle& t : rest.triangles) {
    const Eigen::Vector3f& a = rest.vertices[t[0]];
    const Eigen::Vector3f normal = (rest.vertices[t[1]] - a).cross(rest.vertices[t[2]] - a);
    for (const std::uint32_t corner : t) normals[corner] += normal;
  }
  for (Eigen::Vector3f& normal : normals) normal.normalize();
  return normals;
}

Eigen::Vector3f mean_of(const RestMesh& rest, int keypoint) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  const auto& group = rest.keypoint_vertices[static_cast<std::size_t>(keypoint)];
  for (const int vertex : group) sum += rest.vertices[static_cast<std::size_t>(vertex)];
  return sum / static_cast<float>(group.size());
}

// Returns the nearest point on the surface. Keypoints may lie inside the body, but colour lies on its
// surface.
Eigen::Vector3f on_surface(const RestMesh& rest, const Eigen::Vector3f& point) {
  return *std::min_element(rest.vertices.begin(), rest.vertices.end(), [&](const auto& a, const auto& b) {
    return (a - point).squaredNorm() < (b - point).squaredNorm();
  });
}

// Converts screen values to linear light with gamma 2, which is close to a screen's and cheap to invert.
Colour linear(const Colour& screen) {
  return screen * screen;
}

}  // namespace

CoatPainter::CoatPainter(const RestMesh& rest, const NoiseField& noise) : noise_(noise) {
  eyes_[0] = on_surface(rest, mean_of(rest, left_eye));
  eyes_[1] = on_surface(rest, mean_of(rest, right_eye));
  nose_ = on_surface(rest, mean_of(rest, nose));
  mouth_[0] = mean_of(rest, left_mouth);
  mouth_[1] = mean_of(rest, right_mouth);
  eye_radius_ = 0.2F * (eyes_[0] - eyes_[1]).norm();
  nose_radius_ = 0.3F * (mouth_[0] - mouth_[1]).norm();
  const Eigen::Vector3f eye_middle = 0.5F * (eyes_[0] + eyes_[1]);
  const float face = (nose_ - eye_middle).norm();

  const auto normals = rest_normals(rest);
  zones_.resize(rest.vertices.size());
  for (std::size_t v = 0; v < zones_.size(); ++v) {
    BodyZone& zone = zones_[v];
    const auto& skin = rest.skinning[v];
    zone.rest = rest.vertices[v];
    zone.leg = share(skin, kLegs);
    zone.foot = share(skin, kFeet);
    zone.tail = share(skin, kTail);
    zone.tail_tip = share(skin, kTailTip);
    zone.head = share(skin, kHead);
    zone.ear = share(skin, kEars);
    const float forward = (zone.rest - eye_middle).dot((nose_ - eye_middle) / face) / face;
    zone.muzzle = (zone.head - zone.ear) * smooth_step(0.25F, 0.75F, forward);
    zone.belly = (1.0F - zone.tail) * smooth_step(0.3F, -0.8F, normals[v].y());
    const float neck = share(skin, kNeck) + 0.4F * zone.head * (1.0F - zone.muzzle);
    zone.crest = neck * smooth_step(0.5F, 0.9F, normals[v].y());
    zone.ruff = std::min(
        1.0F, 1.3F * share(skin, kNeck) + 0.3F * zone.head * (1.0F - smooth_step(-0.6F, 0.0F, forward)));
  }
}

BodyZone CoatPainter::zone(const render::Triangle& triangle, float u, float v) const {
  const float w = 1.0F - u - v;
  const BodyZone &a = zones_[triangle[0]], &b = zones_[triangle[1]], &c = zones_[triangle[2]];
  const auto mix = [&](float BodyZone::*field) { return w * a.*field + u * b.*field + v * c.*field; };
  BodyZone zone;
  zone.rest = w * a.rest + u * b.rest + v * c.rest;
  for (const auto field :
       {&BodyZone::leg, &BodyZone::foot, &BodyZone::head, &BodyZone::muzzle, &BodyZone::ear, &BodyZone::tail,
        &BodyZone::tail_tip, &BodyZone::belly, &BodyZone::crest, &BodyZone::ruff}) {
    zone.*field = mix(field);
  }
  return zone;
}

float CoatPainter::wetness(const BodyZone& zone) const {
  const float eye = std::min((zone.rest - eyes_[0]).norm(), (zone.rest - eyes_[1]).norm());
  const float nose_gap = (zone.rest - nose_).norm();
  return std::max(1.0F - smooth_step(0.8F * eye_radius_, 1.1F * eye_radius_, eye),
                  1.0F - smooth_step(0.8F * nose_radius_, 1.2F * nose_radius_, nose_gap));
}

// Returns the colour of the coat without its markings.
Colour CoatPainter::ground_colour(const Coat& coat, const BodyZone& zone, float ruffle) const {
  Colour colour = coat.back;
  const float edge = 1.0F - coat.belly_height;
  colour = blend(colour, coat.belly, smooth_step(edge - 0.2F, edge + 0.2F, zone.belly + 0.15F * ruffle));
  colour = blend(colour, coat.leg, coat.leg_cover * smooth_step(0.3F, 0.7F, zone.leg + 0.1F * ruffle));
  colour = blend(colour, coat.muzzle, smooth_step(0.35F, 0.65F, zone.muzzle + 0.1F * ruffle));
  return colour;
}

// Returns how strongly the marking's colour covers the coat, 0 to 1.
float CoatPainter::marking(const Coat& coat, const BodyZone& zone, const Eigen::Vector3f& individual) const {
  const Eigen::Vector3f p = zone.rest;
  const float scale = coat.mark_scale;
  switch (coat.marking) {
    case Marking::plain:
      return 0.0F;
    case Marking::spots: {
      const auto cell = noise_.cell(scale * p + individual);
      if (static_cast<float>(cell.label) > 255.0F * (0.35F + 0.65F * coat.mark_cover)) return 0.0F;
      const float radius = 0.2F + 0.25F * coat.mark_cover + 0.1F * static_cast<float>(cell.label & 7U) / 7.0F;
      return 1.0F - smooth_step(radius - 0.08F, radius + 0.08F, cell.nearest);
    }
    case Marking::rosettes: {
      const auto cell = noise_.cell(scale * p + individual);
      const float ring = std::abs(cell.nearest - 0.34F);
      const float gaps = noise_.at(2.5F * scale * p - individual);
      const float closed = zone.leg + zone.head + zone.tail;  // small full spots there
      const float full = 1.0F - smooth_step(0.25F, 0.38F, cell.nearest);
      return std::max((1.0F - smooth_step(0.08F, 0.16F, ring)) * (gaps > -0.35F ? 1.0F : 0.2F),
                      closed * full);
    }
    case Marking::stripes:
    case Marking::tabby: {
      const float warp = 0.55F * noise_.octaves(3.0F * p + individual, 2);
      const float along = zone.leg > 0.5F ? p.y() : p.x() + 0.25F * p.y();
      const float wave = std::sin(6.2832F * (scale * along + warp));
      const float threshold = 1.0F - 2.0F * coat.mark_cover + 0.3F * noise_.at(4.0F * p - individual);
      const float sharp = coat.marking == Marking::stripes ? 0.15F : 0.5F;
      return smooth_step(threshold - sharp, threshold + sharp, wave) *
             (coat.marking == Marking::tabby ? 0.65F * (1.0F - zone.belly) : 1.0F);
    }
    case Marking::patches: {
      const float field = noise_.octaves(scale * p + individual, 2);
      const float threshold = 0.5F - coat.mark_cover;
      return smooth_step(threshold - 0.05F, threshold + 0.05F, field);
    }
  }
  return 0.0F;
}

Colour CoatPainter::albedo(const Coat& coat, const BodyZone& zone, const Eigen::Vector3f& individual) const {
  const Eigen::Vector3f& p = zone.rest;
  const float ruffle = noise_.at(7.0F * p + individual);
  Colour colour = ground_colour(coat, zone, ruffle);
  const float hairless = std::max(zone.foot, 0.7F * zone.muzzle);
  colour = blend(colour, coat.mark, marking(coat, zone, individual) * (1.0F - 0.5F * hairless));
  const float crest = std::max(coat.mane * smooth_step(0.25F, 0.5F, zone.crest + 0.15F * ruffle),
                               coat.ruff * smooth_step(0.35F, 0.6F, zone.ruff + 0.1F * ruffle));
  colour = blend(colour, coat.crest, std::max(crest, smooth_step(0.4F, 0.7F, zone.tail_tip)));
  // Hair runs along the body, in fine streaks along x and in coarser tufts.
  const float hair = noise_.at(Eigen::Vector3f(18.0F * p.x(), 70.0F * p.y(), 70.0F * p.z()) + individual);
  const float tufts = noise_.octaves(14.0F * p + individual, 2);
  colour *= 1.0F + coat.shag * (0.6F * hair + 0.8F * tufts + 0.4F * ruffle);
  colour = blend(colour, colour * 0.55F, smooth_step(0.6F, 0.95F, zone.foot));  // paws and hooves
  colour = blend(colour, rgb(188, 140, 128), 0.35F * smooth_step(0.5F, 0.9F, zone.ear));

  const float wet = wetness(zone);
  if (wet > 0.0F) colour = blend(colour, rgb(22, 16, 14), wet);
  const float mouth_line = std::min((p - mouth_[0]).norm(), (p - mouth_[1]).norm());
  colour *= 1.0F - 0.5F * (1.0F - smooth_step(0.0F, 0.6F * nose_radius_, mouth_line));
  return linear(colour.max(0.0F).min(1.0F));
}

}  // namespace q3d::pipeline::world
