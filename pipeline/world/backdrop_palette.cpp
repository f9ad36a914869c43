#include <algorithm>
#include <array>

#include "pipeline/world/backdrop.h"

namespace q3d::pipeline::world {
namespace {

struct Range {
  double low, high;
};

// A row for each place: three pairs of colours (far, ground, blades), the ground's flecks, and the things
// that stand there.
struct PlaceRow {
  Place place;
  std::string_view name;
  Colour far_dark, far_light, ground_dark, ground_light, ground_fleck, blade_dark, blade_light;
  float ground_scale;
  Range far_height, blades, blade_length, things, defocus;
};

const std::array<PlaceRow, kPlaces>& place_table() {
  static const std::array<PlaceRow, kPlaces> kTable{{
      {Place::meadow,
       "meadow",
       rgb(38, 62, 34),
       rgb(108, 134, 72),
       rgb(62, 92, 34),
       rgb(128, 156, 66),
       rgb(168, 172, 98),
       rgb(48, 82, 26),
       rgb(150, 176, 84),
       3.0F,
       {0.02, 0.22},
       {4, 16},
       {0.04, 0.13},
       {0, 5},
       {0.0, 0.02}},
      {Place::savanna,
       "savanna",
       rgb(92, 88, 50),
       rgb(178, 164, 104),
       rgb(142, 118, 66),
       rgb(206, 184, 124),
       rgb(110, 104, 56),
       rgb(128, 104, 54),
       rgb(222, 202, 140),
       2.4F,
       {0.02, 0.22},
       {4, 15},
       {0.06, 0.20},
       {0, 5},
       {0.0, 0.02}},
      {Place::forest,
       "forest",
       rgb(18, 30, 16),
       rgb(92, 112, 52),
       rgb(52, 42, 28),
       rgb(122, 98, 62),
       rgb(92, 104, 44),
       rgb(40, 52, 22),
       rgb(120, 128, 62),
       4.0F,
       {1.5, 1.5},
       {2, 9},
       {0.05, 0.15},
       {3, 10},
       {0.004, 0.03}},
      {Place::snow,
       "snow",
       rgb(74, 84, 88),
       rgb(196, 206, 214),
       rgb(188, 200, 216),
       rgb(242, 245, 248),
       rgb(170, 176, 180),
       rgb(110, 98, 74),
       rgb(166, 154, 120),
       1.2F,
       {0.02, 0.3},
       {0, 1},
       {0.06, 0.14},
       {0, 4},
       {0.0, 0.02}},
      {Place::desert,
       "desert",
       rgb(128, 94, 70),
       rgb(196, 160, 124),
       rgb(176, 136, 94),
       rgb(224, 192, 148),
       rgb(132, 104, 78),
       rgb(110, 100, 62),
       rgb(176, 164, 110),
       1.6F,
       {0.02, 0.3},
       {0, 1.5},
       {0.05, 0.1},
       {0, 5},
       {0.0, 0.02}},
      {Place::rocks,
       "rocks",
       rgb(72, 70, 68),
       rgb(150, 146, 138),
       rgb(88, 84, 78),
       rgb(166, 160, 150),
       rgb(112, 112, 70),
       rgb(70, 78, 42),
       rgb(140, 142, 88),
       2.0F,
       {0.1, 1.0},
       {0, 3},
       {0.05, 0.1},
       {3, 9},
       {0.0, 0.02}},
      {Place::yard,
       "yard",
       rgb(96, 74, 56),
       rgb(168, 148, 124),
       rgb(112, 96, 78),
       rgb(178, 162, 138),
       rgb(196, 178, 122),
       rgb(150, 126, 70),
       rgb(214, 194, 132),
       2.0F,
       {0.15, 0.5},
       {0.5, 3},
       {0.03, 0.07},
       {1, 5},
       {0.0, 0.02}},
      {Place::room,
       "room",
       rgb(82, 62, 50),
       rgb(160, 140, 120),
       rgb(116, 88, 62),
       rgb(150, 114, 80),
       rgb(164, 126, 90),
       rgb(110, 84, 58),
       rgb(110, 84, 58),
       1.5F,
       {0.0, 0.0},
       {0, 0},
       {0.02, 0.02},
       {0, 4},
       {0.002, 0.015}},
      {Place::studio,
       "studio",
       rgb(235, 235, 238),
       rgb(235, 235, 238),
       rgb(222, 222, 225),
       rgb(230, 230, 232),
       rgb(232, 232, 234),
       rgb(205, 205, 208),
       rgb(205, 205, 208),
       0.5F,
       {0.0, 0.0},
       {0, 0},
       {0.02, 0.02},
       {0, 0},
       {0.0, 0.0}},
  }};
  return kTable;
}

const PlaceRow& row_of(Place place) {
  return place_table()[static_cast<std::size_t>(place)];
}

Colour varied(const Colour& colour, double spread, manifests::Rng& rng) {
  const auto gain = static_cast<float>(1.0 + rng.normal(0.0, spread));
  Colour result = colour * gain;
  for (int channel = 0; channel < 3; ++channel) {
    result[channel] += static_cast<float>(rng.normal(0.0, 0.3 * spread));
  }
  return result.max(0.0F).min(1.0F);
}

float drawn(const Range& range, manifests::Rng& rng) {
  return static_cast<float>(rng.uniform(range.low, range.high));
}

// Chooses the background above the horizon: weather outside, leaves in a forest, a wall in a room, a screen
// in a studio.
void draw_sky(Backdrop& b, manifests::Rng& rng) {
  const double weather = rng.uniform();
  if (b.place == Place::forest) {
    b.sky_high = rgb(150, 168, 150);
    b.sky_low = rgb(120, 138, 110);
  } else if (b.place == Place::room) {
    const std::array<Colour, 5> walls{rgb(214, 206, 190), rgb(170, 184, 192), rgb(196, 176, 152),
                                      rgb(150, 160, 140), rgb(190, 150, 140)};
    b.sky_high = walls[static_cast<std::size_t>(rng.below(5))];
    b.sky_low = b.sky_high * 0.85F;
  } else if (b.place == Place::studio) {
    const std::array<Colour, 7> screens{rgb(235, 235, 238), rgb(120, 170, 220), rgb(235, 190, 120),
                                        rgb(150, 205, 150), rgb(225, 150, 150), rgb(70, 80, 100),
                                        rgb(190, 165, 220)};
    b.sky_high = screens[static_cast<std::size_t>(rng.below(7))];
    b.sky_low = blend(b.sky_high, rgb(255, 255, 255), 0.35F);
    const Colour tint = blend(b.sky_high, rgb(255, 255, 255), 0.2F);
    for (Colour* floor : {&b.ground_dark, &b.ground_light, &b.ground_fleck}) *floor = *floor * tint;
  } else if (weather < 0.45) {  // clear
    b.sky_high = rgb(96, 150, 215);
    b.sky_low = rgb(196, 214, 234);
  } else if (weather < 0.85) {  // overcast
    b.sky_high = rgb(205, 212, 215);
    b.sky_low = rgb(226, 231, 233);
  } else {  // evening
    b.sky_high = rgb(150, 160, 186);
    b.sky_low = rgb(224, 184, 150);
  }
}

}  // namespace

std::string_view to_string(Place place) {
  return row_of(place).name;
}

Backdrop draw_palette(Place place, manifests::Rng& rng) {
  const PlaceRow& row = row_of(place);
  Backdrop b;
  b.place = place;
  b.far_dark = row.far_dark;
  b.far_light = row.far_light;
  b.ground_dark = row.ground_dark;
  b.ground_light = row.ground_light;
  b.ground_fleck = row.ground_fleck;
  b.blade_dark = row.blade_dark;
  b.blade_light = row.blade_light;
  b.ground_scale = row.ground_scale;
  b.far_height = drawn(row.far_height, rng);
  b.blades = drawn(row.blades, rng);
  b.blade_length = drawn(row.blade_length, rng);
  b.things = static_cast<int>(drawn(row.things, rng));
  b.defocus = drawn(row.defocus, rng);
  draw_sky(b, rng);

  b.sky_high = varied(b.sky_high, 0.06, rng);
  b.sky_low = varied(b.sky_low, 0.06, rng);
  const auto exposure = static_cast<float>(std::clamp(rng.normal(1.0, 0.12), 0.7, 1.3));
  for (Colour* colour : {&b.far_dark, &b.far_light, &b.ground_dark, &b.ground_light, &b.ground_fleck,
                         &b.blade_dark, &b.blade_light}) {
    *colour = (varied(*colour, 0.06, rng) * exposure).min(1.0F);
  }
  return b;
}

}  // namespace q3d::pipeline::world
