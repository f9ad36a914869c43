#include "pipeline/world/domain.h"

namespace q3d::pipeline::world {
namespace {

// Returns the domain of photographs from the web (ImageNet, COCO), with labels by paid annotators and a
// fitted body.
Domain animal3d() {
  Domain d;
  d.id = SetId::animal3d;
  d.folder = "animal3d";
  d.train = 850;
  d.test = 500;
  d.frequency = &Frequency::animal3d;
  d.stance = {.extreme = 0.03, .resting = 0.12, .spread = 1.0};
  d.side_view = 0.65;
  d.framing = {.fill_low = 0.62, .fill_high = 0.97, .truncated = 0.08, .box_bias = 1.01, .box_spread = 0.015};
  d.sizes = {{1.0, 0.75}, {1.0, 0.75}, {1.0, 0.667}, {0.75, 1.0}, {1.0, 1.0}};
  d.places = {30, 18, 12, 6, 6, 8, 14, 6, 0};
  d.sunny = 0.6;
  d.occluded = 0.15;
  d.lens = {.blur_low = 0.4,
            .blur_high = 0.9,
            .motion = 0.03,
            .noise_low = 1.0,
            .noise_high = 5.0,
            .quality_low = 70,
            .quality_high = 95};
  d.labels = {.visible = 0.97, .self_hidden = 0.7, .occluded = 0.4, .swapped = 0.02, .jitter = 0.006};
  return d;
}

// Returns the domain of pictures that a diffusion model painted over rendered bodies. They are clean and
// saturated, with exact labels and the whole animal in view.
Domain ctrlani3d() {
  Domain d;
  d.id = SetId::ctrlani3d;
  d.folder = "control_animal3dlatest";
  d.train = 650;
  d.test = 500;
  d.frequency = &Frequency::ctrlani3d;
  d.stance = {.extreme = 0.02, .resting = 0.08, .spread = 0.9};
  d.side_view = 0.5;
  d.camera_high_deg = 10.0;
  d.framing = {.fill_low = 0.6, .fill_high = 0.85, .truncated = 0.0, .box_bias = 1.0, .box_spread = 0.0};
  d.sizes = {{1.0, 1.0}};
  d.places = {18, 10, 10, 8, 10, 6, 4, 8, 26};
  d.sunny = 0.75;
  d.occluded = 0.0;
  d.lens = {.blur_low = 0.3,
            .blur_high = 0.5,
            .motion = 0.0,
            .noise_low = 0.0,
            .noise_high = 0.8,
            .saturation = 1.45,
            .contrast = 1.12,
            .warmth_spread = 0.02,
            .quality_low = 92,
            .quality_high = 97};
  d.labels = {.visible = 1.0, .self_hidden = 1.0, .occluded = 1.0, .swapped = 0.0, .jitter = 0.0};
  return d;
}

// Returns the domain of eight collections by many people, with more species, more poses, more distance and
// cruder labels.
Domain superanimal() {
  Domain d;
  d.id = SetId::superanimal;
  d.folder = "superanimal_quadruped";
  d.train = 1400;
  d.test = 600;
  d.frequency = &Frequency::superanimal;
  d.stance = {.extreme = 0.08, .resting = 0.18, .spread = 1.35};
  d.side_view = 0.45;
  d.camera_high_deg = 9.0;
  d.camera_high_spread_deg = 10.0;
  d.framing = {.fill_low = 0.45, .fill_high = 0.98, .truncated = 0.12, .box_bias = 1.02, .box_spread = 0.03};
  d.sizes = {{1.0, 0.75}, {1.0, 0.667}, {0.667, 1.0}, {1.0, 1.0}, {1.0, 0.5625}};
  d.places = {24, 14, 12, 8, 6, 10, 14, 12, 0};
  d.sunny = 0.5;
  d.occluded = 0.28;
  d.lens = {.blur_low = 0.4,
            .blur_high = 1.3,
            .motion = 0.06,
            .noise_low = 1.0,
            .noise_high = 8.0,
            .saturation = 0.95,
            .warmth_spread = 0.06,
            .quality_low = 55,
            .quality_high = 95};
  d.labels = {.visible = 0.95, .self_hidden = 0.6, .occluded = 0.35, .swapped = 0.03, .jitter = 0.008};
  return d;
}

// Returns the domain of frames from films and camera traps, with small or cropped animals, grey nights,
// stamps and movement. Boxes follow the labelled points.
Domain animal_kingdom() {
  Domain d;
  d.id = SetId::animal_kingdom;
  d.folder = "animal_kingdom";
  d.train = 0;
  d.test = 500;
  d.frequency = &Frequency::animal_kingdom;
  d.stance = {.extreme = 0.06, .resting = 0.14, .spread = 1.3};
  d.side_view = 0.5;
  d.camera_high_deg = 6.0;
  d.camera_high_spread_deg = 9.0;
  d.framing = {.fill_low = 0.28, .fill_high = 1.1, .truncated = 0.2, .box_bias = 1.02, .box_spread = 0.02};
  d.sizes = {{2.0, 1.125}};
  d.places = {18, 26, 20, 8, 8, 12, 6, 0, 0};
  d.sunny = 0.45;
  d.occluded = 0.45;
  d.lens = {.blur_low = 0.7,
            .blur_high = 2.0,
            .motion = 0.18,
            .noise_low = 2.0,
            .noise_high = 9.0,
            .saturation = 0.85,
            .contrast = 0.95,
            .warmth_spread = 0.08,
            .grey = 0.22,
            .stamped = 0.25,
            .quality_low = 50,
            .quality_high = 85};
  d.labels = {.visible = 0.93, .self_hidden = 0.4, .occluded = 0.25, .swapped = 0.03, .jitter = 0.008};
  return d;
}

}  // namespace

const Domain& domain_of(SetId id) {
  static const std::array<Domain, kSets> kDomains{animal3d(), ctrlani3d(), superanimal(), animal_kingdom()};
  return kDomains.at(static_cast<std::size_t>(id));
}

}  // namespace q3d::pipeline::world
