// A backdrop surrounds the animal: sky or wall, the distance, the ground and the things that stand on it.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <string_view>

#include "manifests/random.h"
#include "pipeline/world/noise.h"
#include "pipeline/world/scene.h"

namespace q3d::pipeline::world {

enum class Place { meadow, savanna, forest, snow, desert, rocks, yard, room, studio };
inline constexpr int kPlaces = 9;
std::string_view to_string(Place place);

// The colours and things of one picture's surroundings.
struct Backdrop {
  Place place = Place::meadow;
  Colour sky_high, sky_low;    // for a room: the wall
  Colour far_dark, far_light;  // hills, trees, shelves
  Colour ground_dark, ground_light, ground_fleck;
  Colour blade_dark, blade_light;  // grass, twigs, straw
  float far_height = 0.0F;         // height of the things on the horizon, share of the picture's height
  float ground_scale = 1.0F;       // ground patches for each SMAL unit
  float blades = 0.0F;             // blades of grass for 1,000 pixels of ground
  float blade_length = 0.05F;      // SMAL units
  int things = 0;                  // trunks, bushes, stones, posts
  float defocus = 0.0F;            // blur far from the animal, share of the picture's height
};

// Draws the random colours and things of a place.
Backdrop draw_palette(Place place, manifests::Rng& rng);

// Paints the surroundings (BGR, 8 bit) as the camera sees them, in full light and without the animal's
// shadow. The lens is focused at subject_distance (SMAL units).
cv::Mat paint_backdrop(const Backdrop& backdrop, cv::Size size_px, const PictureCamera& camera,
                       const Ground& ground, float subject_distance, const NoiseField& noise,
                       manifests::Rng& rng);

// Paints something that stands behind the animal: a trunk, a bush, a stone, a fence or a cupboard, depending
// on the place.
void paint_thing(cv::Mat& picture, const Backdrop& backdrop, const PictureCamera& camera,
                 const Ground& ground, float subject_distance, manifests::Rng& rng);

// Paints a blade of grass or a twig, from its foot upwards.
void paint_blade(cv::Mat& picture, cv::Point2d foot_px, double length_px, const Colour& colour,
                 manifests::Rng& rng);

cv::Scalar to_bgr(const Colour& colour);  // 0 to 255

}  // namespace q3d::pipeline::world
