// Draws things between the camera and the animal.
#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "manifests/random.h"
#include "pipeline/world/backdrop.h"
#include "pipeline/world/scene.h"

namespace q3d::pipeline::world {

// Paints one occluder (a branch, a trunk or post, tall grass, a stone, bars, or something close and blurred)
// over a part of the box that the animal fills, and adds to `cover` (255 = hidden by an occluder).
void paint_occluder(cv::Mat& picture, cv::Mat1b& cover, const cv::Rect& animal_px, const Backdrop& backdrop,
                    manifests::Rng& rng);

// Paints grass in front of the feet, with blades that start at the vertices nearest the ground. They are too
// thin to hide anything.
void paint_grass_at_feet(cv::Mat& picture, const Backdrop& backdrop, const PictureCamera& camera,
                         const Ground& ground, std::span<const Eigen::Vector3f> vertices,
                         manifests::Rng& rng);

}  // namespace q3d::pipeline::world
