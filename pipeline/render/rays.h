// Casts rays against one triangle mesh. No other file uses Embree.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>

namespace q3d::pipeline::render {

using Triangle = std::array<std::uint32_t, 3>;

struct SurfaceHit {
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  std::uint32_t triangle = kNone;
  float u = 0.0F, v = 0.0F;  // weights of the triangle's second and third corner
  float distance = 0.0F;     // in multiples of the direction's length
  bool found() const { return triangle != kNone; }
};

// Owns the ray-tracing device. Thread-safe; it starts no threads of its own.
class RayDevice {
 public:
  RayDevice();  // throws std::runtime_error when the library cannot start
  ~RayDevice();
  RayDevice(const RayDevice&) = delete;
  RayDevice& operator=(const RayDevice&) = delete;

 private:
  friend class RayMesh;
  struct Handle;
  std::unique_ptr<Handle> handle_;
};

// A mesh that is prepared for ray queries. It is immutable, and queries are thread-safe. The device must
// outlive it.
class RayMesh {
 public:
  RayMesh(const RayDevice& device, std::span<const Eigen::Vector3f> vertices,
          std::span<const Triangle> triangles);
  ~RayMesh();
  RayMesh(const RayMesh&) = delete;
  RayMesh& operator=(const RayMesh&) = delete;

  // Finds the nearest surface along each direction from the origin of coordinates. `hits` must have as many
  // elements as `directions`.
  void nearest(std::span<const Eigen::Vector3f> directions, std::span<SurfaceHit> hits) const;

  // Sets blocked[i] to 1 if the mesh lies on the ray from origins[i] along the common direction, else to 0.
  void blocked(std::span<const Eigen::Vector3f> origins, const Eigen::Vector3f& direction,
               std::span<std::uint8_t> blocked) const;

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
};

}  // namespace q3d::pipeline::render
