#include "pipeline/world/species.h"

#include <algorithm>
#include <cmath>

namespace q3d::pipeline::world {
namespace {

Colour shaded(const Colour& colour, float gain, const Colour& tint) {
  return (colour * gain * tint).min(1.0F);
}

}  // namespace

std::string_view to_string(Family family) {
  constexpr std::array<std::string_view, kFamilies> kNames{"Felidae", "Canidae", "Equidae", "Bovidae",
                                                           "Hippopotamidae"};
  return kNames[static_cast<std::size_t>(family)];
}

Coat draw_coat(const Species& species, manifests::Rng& rng) {
  Coat coat = species.coats[static_cast<std::size_t>(rng.below(static_cast<int>(species.coats.size())))];
  const auto gain = static_cast<float>(std::clamp(std::exp(rng.normal(0.0, 0.10)), 0.75, 1.3));
  const Colour tint(static_cast<float>(1.0 + rng.normal(0.0, 0.03)), 1.0F,
                    static_cast<float>(1.0 + rng.normal(0.0, 0.04)));
  for (Colour* colour : {&coat.back, &coat.belly, &coat.leg, &coat.muzzle, &coat.crest}) {
    *colour = shaded(*colour, gain, tint);
  }
  coat.mark = shaded(coat.mark, std::sqrt(gain), tint);
  coat.mark_scale *= static_cast<float>(std::exp(rng.normal(0.0, 0.08)));
  coat.mark_cover *= static_cast<float>(std::exp(rng.normal(0.0, 0.06)));
  coat.belly_height *= static_cast<float>(rng.uniform(0.8, 1.2));
  return coat;
}

}  // namespace q3d::pipeline::world
