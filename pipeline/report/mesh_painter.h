// Draws bodies over pictures by casting rays against the mesh, shaded and with smooth edges.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace q3d::pipeline::report {

// A camera at the origin that looks along z, with x to the right and y down. Pixel (x, y) of a square picture
// sees the direction ((x - centre) / focal, (y - centre) / focal, 1).
struct TileCamera {
  double focal_px = 0.0;
  double centre_px = 0.0;
};

// Returns the camera of the network's crop in a square tile that shows `context` times the crop. Tile pixel i
// shows the crop coordinate (i / side - 0.5) * context, as in loaders::pictures::keypoints_to_crop.
TileCamera crop_camera(int tile_side_px, double context);

using Vertices = std::vector<Eigen::Vector3f>;

// Returns the same body as seen from its left or right in the photograph: turned by 90 degrees about the
// vertical axis through its middle, and moved along z until it fills the tile.
Vertices side_view(const Vertices& vertices, const TileCamera& camera, int tile_side_px);

class MeshPainter {
 public:
  explicit MeshPainter(std::span<const std::array<std::int32_t, 3>> faces);
  ~MeshPainter();
  MeshPainter(const MeshPainter&) = delete;
  MeshPainter& operator=(const MeshPainter&) = delete;

  // Draws the mesh into an 8-bit RGB tile. `vertices` are in the camera's frame; triangles that reach behind
  // the camera draw nothing. `opacity` applies to a pixel that the mesh covers completely. Returns the
  // coverage of each pixel, 0 to 255. Throws std::invalid_argument for another number of vertices than the
  // faces name, or another kind of tile.
  cv::Mat paint(cv::Mat& tile, const Vertices& vertices, const TileCamera& camera, const cv::Scalar& colour,
                double opacity) const;

 private:
  struct Rays;
  std::unique_ptr<Rays> rays_;
};

}  // namespace q3d::pipeline::report
