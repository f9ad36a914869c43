// Describes the four datasets that the world imitates: their content, how they are photographed and how they
// are labelled.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "pipeline/world/annotator.h"
#include "pipeline/world/backdrop.h"
#include "pipeline/world/framing.h"
#include "pipeline/world/lens.h"
#include "pipeline/world/species.h"
#include "pipeline/world/stance.h"

namespace q3d::pipeline::world {

enum class SetId : int { animal3d, ctrlani3d, superanimal, animal_kingdom };
inline constexpr int kSets = 4;

struct Domain {
  SetId id = SetId::animal3d;
  std::string_view folder;  // path below the world's folder
  int train = 0, test = 0;  // pictures at share 1
  double Frequency::*frequency = nullptr;

  StanceHabits stance;
  double side_view = 0.6;  // share of pictures from about the animal's side; the rest from anywhere
  double camera_high_deg = 7.0, camera_high_spread_deg = 7.0;  // the camera's elevation over the animal
  FramingHabits framing;
  std::vector<cv::Size2d> sizes;  // picture sizes in units of WorldOptions::picture_px; equally frequent
  std::array<double, kPlaces> places{};  // weights, in the order of Place
  double sunny = 0.6;                    // share of pictures with a clear sun
  double occluded = 0.2;                 // share with something in front of the animal
  LensHabits lens;
  LabelHabits labels;
};

const Domain& domain_of(SetId id);

}  // namespace q3d::pipeline::world
