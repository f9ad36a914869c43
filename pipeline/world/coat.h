// A coat gives colour as a function of the position on the resting body, so that markings move with the skin.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "manifests/random.h"
#include "pipeline/world/bodies.h"
#include "pipeline/world/noise.h"
#include "pipeline/world/scene.h"

namespace q3d::pipeline::world {

enum class Marking : std::uint8_t { plain, spots, rosettes, stripes, tabby, patches };

// The colours of one animal (screen values). Zones blend into each other.
struct Coat {
  Colour back{0.5F, 0.4F, 0.3F};
  Colour belly{0.7F, 0.65F, 0.6F};
  Colour leg{0.5F, 0.4F, 0.3F};
  Colour muzzle{0.5F, 0.4F, 0.3F};
  Colour mark{0.1F, 0.1F, 0.1F};    // spots, stripes, patches
  Colour crest{0.2F, 0.15F, 0.1F};  // mane and tail tip
  Marking marking = Marking::plain;
  float mark_scale = 10.0F;   // marks for each SMAL unit
  float mark_cover = 0.5F;    // 0 sparse, 1 dense
  float belly_height = 0.3F;  // height up to which the belly's colour reaches, 0 to 1
  float leg_cover = 0.0F;     // 0: legs have the body's colour; 1: legs have their own
  float mane = 0.0F;          // 0 none, 1 a full mane along neck and withers
  float ruff = 0.0F;          // 1 a lion's ruff
  float shag = 0.15F;         // unevenness of the fur
  float gloss = 0.1F;
};

// The zone of a point on the body. It is interpolated linearly over triangles.
struct BodyZone {
  Eigen::Vector3f rest;  // position on the resting template
  float leg = 0.0F, foot = 0.0F, head = 0.0F, muzzle = 0.0F, ear = 0.0F, tail = 0.0F, tail_tip = 0.0F;
  float belly = 0.0F;  // 1 underneath, 0 on the back
  float crest = 0.0F;  // 1 along the upper line of the neck
  float ruff = 0.0F;   // 1 around the neck and behind the face
};

class CoatPainter {
 public:
  CoatPainter(const RestMesh& rest, const NoiseField& noise);

  BodyZone zone(const render::Triangle& triangle, float u, float v) const;  // u, v as in SurfaceHit
  // Returns the colour in linear light. `individual` shifts the markings, so that animals differ.
  Colour albedo(const Coat& coat, const BodyZone& zone, const Eigen::Vector3f& individual) const;
  // Returns 1 on the wet surfaces of eyes and nose.
  float wetness(const BodyZone& zone) const;

 private:
  Colour ground_colour(const Coat& coat, const BodyZone& zone, float ruffle) const;
  float marking(const Coat& coat, const BodyZone& zone, const Eigen::Vector3f& individual) const;

  std::vector<BodyZone> zones_;  // one for each vertex
  const NoiseField& noise_;
  Eigen::Vector3f eyes_[2], nose_, mouth_[2];
  float eye_radius_, nose_radius_;
};

}  // namespace q3d::pipeline::world
