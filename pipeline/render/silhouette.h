// A silhouette is the set of pixels of the network's crop that a mesh covers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace q3d::pipeline::render {

// Fills the triangles of a mesh. points: V x (x, y) px, with the first pixel's centre at (0, 0); faces: three
// points each. Returns side x side numbers, row-major: 255 where a pixel's centre lies in a triangle or on
// its edge, else 0. Triangles with a point that is not finite are left out. Throws std::out_of_range for a
// face that names no point.
std::vector<std::uint8_t> fill_triangles(std::span<const float> points,
                                         std::span<const std::array<std::int32_t, 3>> faces, int side);

// Returns the silhouette of a body in the crop, 256 x 256. vertices: V x 3, SMAL units; translation: that of
// the crop's camera with focal 1000 px. Triangles that reach behind the camera are left out.
std::vector<std::uint8_t> crop_silhouette(std::span<const float> vertices,
                                          const std::array<float, 3>& translation,
                                          std::span<const std::array<std::int32_t, 3>> faces);

}  // namespace q3d::pipeline::render
