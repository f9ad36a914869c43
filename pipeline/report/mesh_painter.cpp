#include "pipeline/report/mesh_painter.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "pipeline/render/rays.h"
#include "smal/camera.h"

namespace q3d::pipeline::report {
namespace {

constexpr int kRaysPerSide = 2;  // rays along each side of a pixel
constexpr float kAmbient = 0.4F;
constexpr double kFilledShare = 0.84;  // fraction of a tile that the side view fills

// The direction from the surface to the light, which is at the upper left, behind the camera.
const Eigen::Vector3f kToLight = Eigen::Vector3f(-0.35F, -0.65F, -0.75F).normalized();

// Returns a normal for each vertex, which is the area-weighted sum of its triangles' normals.
Vertices vertex_normals(const Vertices& vertices, std::span<const render::Triangle> triangles) {
  Vertices normals(vertices.size(), Eigen::Vector3f::Zero());
  for (const render::Triangle& triangle : triangles) {
    const Eigen::Vector3f normal =
        (vertices[triangle[1]] - vertices[triangle[0]]).cross(vertices[triangle[2]] - vertices[triangle[0]]);
    for (const std::uint32_t corner : triangle) normals[corner] += normal;
  }
  return normals;
}

// Returns the pixels that the mesh may touch, which is the bounding box of its projected vertices, or the
// whole tile if a vertex lies behind the camera.
cv::Rect touched(const Vertices& vertices, const TileCamera& camera, int side) {
  double left = side, top = side, right = 0, bottom = 0;
  for (const Eigen::Vector3f& vertex : vertices) {
    if (!(vertex.z() > 1e-3F)) return {0, 0, side, side};
    const double x = camera.centre_px + camera.focal_px * vertex.x() / vertex.z();
    const double y = camera.centre_px + camera.focal_px * vertex.y() / vertex.z();
    left = std::min(left, x);
    right = std::max(right, x);
    top = std::min(top, y);
    bottom = std::max(bottom, y);
  }
  const auto clamped = [&](double value) { return static_cast<int>(std::clamp(value, 0.0, double(side))); };
  const int x0 = clamped(left - 2), y0 = clamped(top - 2);
  return {x0, y0, clamped(right + 3) - x0, clamped(bottom + 3) - y0};
}

Eigen::Vector3f direction(const TileCamera& camera, int x, int y, int sub_x, int sub_y) {
  const auto offset = [](int sub) { return (sub + 0.5) / kRaysPerSide - 0.5; };
  return {static_cast<float>((x + offset(sub_x) - camera.centre_px) / camera.focal_px),
          static_cast<float>((y + offset(sub_y) - camera.centre_px) / camera.focal_px), 1.0F};
}

}  // namespace

TileCamera crop_camera(int tile_side_px, double context) {
  return {smal::kFocalInCropUnits * tile_side_px / context, tile_side_px / 2.0};
}

Vertices side_view(const Vertices& vertices, const TileCamera& camera, int tile_side_px) {
  if (vertices.empty()) return {};
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : vertices) box.extend(vertex);
  const Eigen::Vector3f middle = box.center();
  const Eigen::Vector3f size = box.sizes();
  // After the turn, the width in the picture is the old extent in z, and the nearest point lies half the old
  // width before the middle.
  const double widest = std::max(size.z(), size.y());
  const auto depth =
      static_cast<float>(camera.focal_px * widest / (kFilledShare * tile_side_px) + size.x() / 2.0F);
  Vertices turned;
  turned.reserve(vertices.size());
  for (const Eigen::Vector3f& vertex : vertices) {
    const Eigen::Vector3f from_middle = vertex - middle;
    turned.emplace_back(-from_middle.z(), from_middle.y(), from_middle.x() + depth);
  }
  return turned;
}

struct MeshPainter::Rays {
  render::RayDevice device;
  std::vector<render::Triangle> triangles;
  std::size_t vertices = 0;  // number of vertices that the triangles use
};

MeshPainter::MeshPainter(std::span<const std::array<std::int32_t, 3>> faces)
    : rays_(std::make_unique<Rays>()) {
  for (const auto& face : faces) {
    render::Triangle& triangle = rays_->triangles.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) {
      triangle[c] = static_cast<std::uint32_t>(face[c]);
      rays_->vertices = std::max(rays_->vertices, static_cast<std::size_t>(face[c]) + 1);
    }
  }
}

MeshPainter::~MeshPainter() = default;

cv::Mat MeshPainter::paint(cv::Mat& tile, const Vertices& vertices, const TileCamera& camera,
                           const cv::Scalar& colour, double opacity) const {
  if (tile.type() != CV_8UC3 || tile.rows != tile.cols || vertices.size() < rays_->vertices) {
    throw std::invalid_argument("MeshPainter: got a tile of " + std::to_string(tile.cols) + " x " +
                                std::to_string(tile.rows) + " and " + std::to_string(vertices.size()) +
                                " vertices, expected a square 8-bit RGB tile and " +
                                std::to_string(rays_->vertices) + " vertices");
  }
  const render::RayMesh mesh(rays_->device, vertices, rays_->triangles);
  const Vertices normals = vertex_normals(vertices, rays_->triangles);
  const auto light_of = [&](const render::SurfaceHit& hit) {
    const render::Triangle& triangle = rays_->triangles[hit.triangle];
    Eigen::Vector3f normal = (1.0F - hit.u - hit.v) * normals[triangle[0]] + hit.u * normals[triangle[1]] +
                             hit.v * normals[triangle[2]];
    normal.normalize();
    return kAmbient + (1.0F - kAmbient) * std::max(0.0F, normal.dot(kToLight));
  };

  cv::Mat coverage = cv::Mat::zeros(tile.size(), CV_8UC1);
  const cv::Rect area = touched(vertices, camera, tile.cols);
  constexpr int kRays = kRaysPerSide * kRaysPerSide;
  std::vector<Eigen::Vector3f> directions(static_cast<std::size_t>(area.width) * kRays);
  std::vector<render::SurfaceHit> hits(directions.size());
  for (int y = area.y; y < area.y + area.height; ++y) {
    for (int i = 0; i < area.width * kRays; ++i) {
      const int sub = i % kRays;
      directions[static_cast<std::size_t>(i)] =
          direction(camera, area.x + i / kRays, y, sub % kRaysPerSide, sub / kRaysPerSide);
    }
    mesh.nearest(directions, hits);
    for (int x = 0; x < area.width; ++x) {
      float light = 0.0F;
      int found = 0;
      for (int sub = 0; sub < kRays; ++sub) {
        const render::SurfaceHit& hit = hits[static_cast<std::size_t>(x * kRays + sub)];
        if (!hit.found()) continue;
        light += light_of(hit);
        ++found;
      }
      if (found == 0) continue;
      const double share = static_cast<double>(found) / kRays;
      coverage.at<std::uint8_t>(y, area.x + x) = cv::saturate_cast<std::uint8_t>(255.0 * share);
      auto& pixel = tile.at<cv::Vec3b>(y, area.x + x);
      for (int channel = 0; channel < 3; ++channel) {
        const double lit = colour[channel] * light / found;
        pixel[channel] =
            cv::saturate_cast<std::uint8_t>(pixel[channel] + opacity * share * (lit - pixel[channel]));
      }
    }
  }
  return coverage;
}

}  // namespace q3d::pipeline::report
