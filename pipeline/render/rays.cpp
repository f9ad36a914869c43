#include "pipeline/render/rays.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

namespace q3d::pipeline::render {
namespace {

constexpr std::size_t kPacket = 8;

// Embree 3 takes a context by pointer before the rays; Embree 4 takes optional arguments after them.
#if RTC_VERSION_MAJOR >= 4
void intersect(const int* valid, RTCScene scene, RTCRayHit8& rays) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcIntersect8(valid, scene, &rays, &arguments);
}
void occluded(const int* valid, RTCScene scene, RTCRay8& rays) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcOccluded8(valid, scene, &rays, &arguments);
}
#else
void intersect(const int* valid, RTCScene scene, RTCRayHit8& rays) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(valid, scene, &context, &rays);
}
void occluded(const int* valid, RTCScene scene, RTCRay8& rays) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded8(valid, scene, &context, &rays);
}
#endif

void set_ray(RTCRay8& rays, std::size_t lane, const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
             float near) {
  rays.org_x[lane] = origin.x();
  rays.org_y[lane] = origin.y();
  rays.org_z[lane] = origin.z();
  rays.dir_x[lane] = direction.x();
  rays.dir_y[lane] = direction.y();
  rays.dir_z[lane] = direction.z();
  rays.tnear[lane] = near;
  rays.tfar[lane] = std::numeric_limits<float>::infinity();
  rays.time[lane] = 0.0F;
  rays.mask[lane] = 0xFFFFFFFFU;
  rays.flags[lane] = 0;
}

}  // namespace

struct RayDevice::Handle {
  RTCDevice device = nullptr;
};

RayDevice::RayDevice() : handle_(std::make_unique<Handle>()) {
  // With "threads=1", Embree would hold all of TBB, and with it the whole program, to one thread.
  handle_->device = rtcNewDevice("start_threads=0");
  if (handle_->device == nullptr) {
    throw std::runtime_error("ray tracing: Embree cannot start (error " +
                             std::to_string(static_cast<int>(rtcGetDeviceError(nullptr))) + ")");
  }
}

RayDevice::~RayDevice() {
  rtcReleaseDevice(handle_->device);
}

struct RayMesh::Handle {
  RTCScene scene = nullptr;
  ~Handle() {
    if (scene != nullptr) rtcReleaseScene(scene);
  }
};

RayMesh::RayMesh(const RayDevice& device, std::span<const Eigen::Vector3f> vertices,
                 std::span<const Triangle> triangles)
    : handle_(std::make_unique<Handle>()) {
  RTCDevice rtc = device.handle_->device;
  handle_->scene = rtcNewScene(rtc);
  rtcSetSceneBuildQuality(handle_->scene, RTC_BUILD_QUALITY_LOW);
  RTCGeometry geometry = rtcNewGeometry(rtc, RTC_GEOMETRY_TYPE_TRIANGLE);
  static_assert(sizeof(Eigen::Vector3f) == 12);
  void* to =
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, vertices.size());
  if (to != nullptr) std::memcpy(to, vertices.data(), vertices.size_bytes());
  void* index =
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size());
  if (index != nullptr) std::memcpy(index, triangles.data(), triangles.size_bytes());
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(handle_->scene, geometry);
  rtcReleaseGeometry(geometry);
  // The arena has one thread: pictures run in parallel already, and a hierarchy that one thread builds is
  // always the same.
  tbb::task_arena alone(1);
  alone.execute([&] { rtcCommitScene(handle_->scene); });
  if (const RTCError error = rtcGetDeviceError(rtc); error != RTC_ERROR_NONE) {
    throw std::runtime_error("ray tracing: Embree refuses a mesh of " + std::to_string(vertices.size()) +
                             " vertices and " + std::to_string(triangles.size()) + " triangles (error " +
                             std::to_string(static_cast<int>(error)) + ")");
  }
}

RayMesh::~RayMesh() = default;

void RayMesh::nearest(std::span<const Eigen::Vector3f> directions, std::span<SurfaceHit> hits) const {
  if (hits.size() != directions.size()) {
    throw std::invalid_argument("nearest: " + std::to_string(directions.size()) +
                                " directions but room for " + std::to_string(hits.size()) + " hits");
  }
  for (std::size_t begin = 0; begin < directions.size(); begin += kPacket) {
    const std::size_t count = std::min(kPacket, directions.size() - begin);
    alignas(32) RTCRayHit8 rays;
    alignas(32) int valid[kPacket];
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      set_ray(rays.ray, lane, Eigen::Vector3f::Zero(), directions[begin + std::min(lane, count - 1)], 0.0F);
      rays.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
      rays.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
    }
    intersect(valid, handle_->scene, rays);
    for (std::size_t lane = 0; lane < count; ++lane) {
      SurfaceHit& hit = hits[begin + lane];
      const bool found = rays.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID;
      hit = found ? SurfaceHit{rays.hit.primID[lane], rays.hit.u[lane], rays.hit.v[lane], rays.ray.tfar[lane]}
                  : SurfaceHit{};
    }
  }
}

void RayMesh::blocked(std::span<const Eigen::Vector3f> origins, const Eigen::Vector3f& direction,
                      std::span<std::uint8_t> blocked) const {
  if (blocked.size() != origins.size()) {
    throw std::invalid_argument("blocked: " + std::to_string(origins.size()) + " origins but room for " +
                                std::to_string(blocked.size()) + " answers");
  }
  for (std::size_t begin = 0; begin < origins.size(); begin += kPacket) {
    const std::size_t count = std::min(kPacket, origins.size() - begin);
    alignas(32) RTCRay8 rays;
    alignas(32) int valid[kPacket];
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      valid[lane] = lane < count ? -1 : 0;
      set_ray(rays, lane, origins[begin + std::min(lane, count - 1)], direction, 1e-3F);
    }
    occluded(valid, handle_->scene, rays);
    for (std::size_t lane = 0; lane < count; ++lane) {
      blocked[begin + lane] = rays.tfar[lane] < 0.0F ? 1 : 0;  // Embree marks a blocked ray by tfar = -inf
    }
  }
}

}  // namespace q3d::pipeline::render
