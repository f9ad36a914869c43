// Writes bodies as files for 3D programs: Wavefront OBJ and binary glTF.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "loaders/pictures/crop.h"
#include "pipeline/report/mesh_painter.h"

namespace q3d::pipeline::report {

// A body in the frame of its crop's camera, with the box that says where the crop lies in the photograph.
struct PhotoBody {
  std::string id;
  std::string kind;                    // "retained", "refined", "prediction", ...: what the body is
  const Vertices* vertices = nullptr;  // SMAL units, x right, y down, z forward
  loaders::pictures::SquareBox box;
};

// Both files have the vertices in the order of the body asset, with its faces. The axes are those of 3D
// programs: x right, y up, z towards the viewer, the photograph's camera at the origin. A vertex (X, Y, Z)
// lies at pixel (cx - f X / Z, cy + f Y / Z) of the photograph, where (cx, cy) is the centre of the box and
// f = 1000 / 256 of its side, all in px; comments (OBJ) and `extras` (glTF) state these numbers.
std::string obj_text(const PhotoBody& body, std::span<const std::array<std::int32_t, 3>> faces);

// The scene also has a camera that sees the network's crop.
std::vector<std::byte> glb_bytes(const PhotoBody& body, std::span<const std::array<std::int32_t, 3>> faces);

}  // namespace q3d::pipeline::report
