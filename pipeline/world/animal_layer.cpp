#include "pipeline/world/animal_layer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace q3d::pipeline::world {
namespace {

std::vector<Eigen::Vector3f> moved(std::span<const Eigen::Vector3f> points, const Eigen::Vector3f& by) {
  std::vector<Eigen::Vector3f> result(points.begin(), points.end());
  for (Eigen::Vector3f& point : result) point += by;
  return result;
}

std::vector<Eigen::Vector3f> vertex_normals(std::span<const Eigen::Vector3f> vertices,
                                            std::span<const render::Triangle> triangles) {
  std::vector<Eigen::Vector3f> normals(vertices.size(), Eigen::Vector3f::Zero());
  for (const render::Triangle& t : triangles) {
    const Eigen::Vector3f normal = (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
    for (const std::uint32_t corner : t) normals[corner] += normal;
  }
  for (Eigen::Vector3f& normal : normals) normal.normalize();
  return normals;
}

// Returns the rectangle of pixels that may show the animal.
cv::Rect projected_rect(std::span<const Eigen::Vector3f> vertices, const PictureCamera& camera,
                        cv::Size size) {
  double left = size.width, top = size.height, right = 0.0, bottom = 0.0;
  for (const Eigen::Vector3f& vertex : vertices) {
    const Eigen::Vector2d p = camera.project(vertex);
    left = std::min(left, p.x());
    right = std::max(right, p.x());
    top = std::min(top, p.y());
    bottom = std::max(bottom, p.y());
  }
  const cv::Point first(std::max(0, static_cast<int>(left) - 1), std::max(0, static_cast<int>(top) - 1));
  const cv::Point last(std::min(size.width, static_cast<int>(right) + 3),
                       std::min(size.height, static_cast<int>(bottom) + 3));
  return last.x > first.x && last.y > first.y ? cv::Rect(first, last) : cv::Rect();
}

Colour square_root(const Colour& linear) {
  return linear.max(0.0F).sqrt();
}

}  // namespace

struct AnimalLayer::Fragment {
  int row, column;
  float coverage;  // (0, 1]
  render::SurfaceHit hit;
  Eigen::Vector3f ray;
};

AnimalLayer::AnimalLayer(const render::RayDevice& device, const RestMesh& rest, const Body& body,
                         const Eigen::Vector3f& translation)
    : rest_(rest),
      vertices_(moved(body.vertices, translation)),
      normals_(vertex_normals(vertices_, rest.triangles)),
      rays_(device, vertices_, rest.triangles) {}

// Casts one ray for each pixel. Pixels on the outline get four more rays and may be partly covered.
std::vector<AnimalLayer::Fragment> AnimalLayer::fragments(cv::Size picture_px,
                                                          const PictureCamera& camera) const {
  const cv::Rect area = projected_rect(vertices_, camera, picture_px);
  std::vector<Eigen::Vector3f> rays;
  rays.reserve(static_cast<std::size_t>(area.area()));
  for (int row = area.y; row < area.y + area.height; ++row) {
    for (int column = area.x; column < area.x + area.width; ++column) rays.push_back(camera.ray(column, row));
  }
  std::vector<render::SurfaceHit> hits(rays.size());
  rays_.nearest(rays, hits);

  const auto found = [&](int row, int column) {
    return row >= 0 && row < area.height && column >= 0 && column < area.width &&
           hits[static_cast<std::size_t>(row * area.width + column)].found();
  };
  constexpr int kSubRays = 4;
  std::vector<Fragment> result, outline;
  std::vector<Eigen::Vector3f> sub_rays;
  for (int row = 0; row < area.height; ++row) {
    for (int column = 0; column < area.width; ++column) {
      const int around = found(row, column) + found(row, column - 1) + found(row, column + 1) +
                         found(row - 1, column) + found(row + 1, column);
      if (around == 0) continue;
      const auto index = static_cast<std::size_t>(row * area.width + column);
      const Fragment fragment{row + area.y, column + area.x, 1.0F, hits[index], rays[index]};
      if (around == 5) {
        result.push_back(fragment);
        continue;
      }
      outline.push_back(fragment);
      for (int sub = 0; sub < kSubRays; ++sub) {
        sub_rays.push_back(camera.ray(fragment.column + (sub % 2 == 0 ? -0.25 : 0.25),
                                      fragment.row + (sub / 2 == 0 ? -0.25 : 0.25)));
      }
    }
  }
  std::vector<render::SurfaceHit> sub_hits(sub_rays.size());
  rays_.nearest(sub_rays, sub_hits);
  for (std::size_t i = 0; i < outline.size(); ++i) {
    int covered = 0;
    for (int sub = 0; sub < kSubRays; ++sub) {
      const std::size_t index = kSubRays * i + static_cast<std::size_t>(sub);
      if (!sub_hits[index].found()) continue;
      ++covered;
      if (!outline[i].hit.found()) {
        outline[i].hit = sub_hits[index];
        outline[i].ray = sub_rays[index];
      }
    }
    if (covered == 0) continue;
    outline[i].coverage = static_cast<float>(covered) / kSubRays;
    result.push_back(outline[i]);
  }
  return result;
}

cv::Mat1b AnimalLayer::paint(cv::Mat& picture, const PictureCamera& camera, const Ground& ground,
                             const Light& light, const CoatPainter& painter, const Coat& coat,
                             const Eigen::Vector3f& individual) const {
  const std::vector<Fragment> pixels = fragments(picture.size(), camera);
  std::vector<Eigen::Vector3f> normals(pixels.size()), origins(pixels.size());
  std::vector<std::uint8_t> shadow(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const render::SurfaceHit& hit = pixels[i].hit;
    const render::Triangle& t = rest_.triangles[hit.triangle];
    normals[i] = ((1.0F - hit.u - hit.v) * normals_[t[0]] + hit.u * normals_[t[1]] + hit.v * normals_[t[2]])
                     .normalized();
    origins[i] = hit.distance * pixels[i].ray + 0.015F * normals[i];
  }
  rays_.blocked(origins, light.to_sun, shadow);

  cv::Mat1b silhouette(picture.size(), std::uint8_t{0});
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const Fragment& pixel = pixels[i];
    const BodyZone zone = painter.zone(rest_.triangles[pixel.hit.triangle], pixel.hit.u, pixel.hit.v);
    const float upward = 0.5F + 0.5F * normals[i].dot(ground.up);
    const float sun = shadow[i] != 0 ? 0.0F : std::max(0.0F, (normals[i].dot(light.to_sun) + 0.15F) / 1.15F);
    // The belly and the insides of the legs receive little light from the sky.
    const float open = 1.0F - 0.45F * zone.belly;
    const Colour incoming = open * blend(light.bounce, light.sky, upward) + sun * light.sun;
    const Eigen::Vector3f halfway = (light.to_sun - pixel.ray.normalized()).normalized();
    const float facing = std::max(0.0F, normals[i].dot(halfway));
    const float wet = painter.wetness(zone);
    const float shine = coat.gloss * std::pow(facing, 12.0F) + 0.9F * wet * std::pow(facing, 60.0F);
    Colour seen = painter.albedo(coat, zone, individual) * incoming;
    if (shadow[i] == 0) seen += shine * light.sun;
    const Colour screen = square_root(seen).min(1.0F) * 255.0F;

    auto& out = picture.at<cv::Vec3b>(pixel.row, pixel.column);
    for (int channel = 0; channel < 3; ++channel) {
      const float below = out[channel];
      out[channel] = static_cast<std::uint8_t>(below + pixel.coverage * (screen[2 - channel] - below) + 0.5F);
    }
    if (pixel.coverage >= 0.5F) silhouette(pixel.row, pixel.column) = 255;
  }
  return silhouette;
}

void AnimalLayer::cast_shadow(cv::Mat& picture, const PictureCamera& camera, const Ground& ground,
                              const Light& light) const {
  // Shadows are soft, so a quarter of the pixels is enough.
  constexpr int kStep = 2;
  const cv::Size size((picture.cols + kStep - 1) / kStep, (picture.rows + kStep - 1) / kStep);
  const Eigen::Vector3f centre =
      std::accumulate(vertices_.begin(), vertices_.end(), Eigen::Vector3f(0, 0, 0)) /
      static_cast<float>(vertices_.size());
  float radius = 0.0F;
  for (const Eigen::Vector3f& vertex : vertices_) radius = std::max(radius, (vertex - centre).norm());

  const auto darkness = [&](const Eigen::Vector3f& direction) {
    std::vector<Eigen::Vector3f> origins;
    std::vector<std::size_t> places;
    for (int row = 0; row < size.height; ++row) {
      for (int column = 0; column < size.width; ++column) {
        const Eigen::Vector3f ray = camera.ray(kStep * column, kStep * row);
        const float t = ground.hit(ray);
        if (t <= 0.0F) continue;
        const Eigen::Vector3f origin = t * ray + 0.004F * ground.up;
        if ((centre - origin).cross(direction).norm() > radius) continue;  // the ray misses the animal
        origins.push_back(origin);
        places.push_back(static_cast<std::size_t>(row * size.width + column));
      }
    }
    std::vector<std::uint8_t> blocked(origins.size());
    rays_.blocked(origins, direction, blocked);
    cv::Mat1b result(size, std::uint8_t{0});
    for (std::size_t i = 0; i < places.size(); ++i) {
      result.data[places[i]] = blocked[i] != 0 ? 255 : 0;
    }
    return result;
  };

  cv::Mat1b sun = darkness(light.to_sun), above = darkness(ground.up);
  cv::GaussianBlur(sun, sun, {}, 0.004 * picture.rows + 0.5);
  cv::GaussianBlur(above, above, {}, 0.022 * picture.rows + 0.5);
  cv::Mat1b shade(size);
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      const float left = (1.0F - light.ground_shadow * sun(row, column) / 255.0F) *
                         (1.0F - 0.45F * above(row, column) / 255.0F);
      shade(row, column) = static_cast<std::uint8_t>(255.0F * left + 0.5F);
    }
  }
  cv::Mat1b full;
  cv::resize(shade, full, picture.size(), 0, 0, cv::INTER_LINEAR);
  for (int row = 0; row < picture.rows; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < picture.cols; ++column) {
      const int keep = full(row, column);
      if (keep == 255) continue;
      for (int channel = 0; channel < 3; ++channel) {
        out[column][channel] = static_cast<std::uint8_t>(out[column][channel] * keep / 255);
      }
    }
  }
}

std::vector<std::uint8_t> AnimalLayer::hidden(std::span<const Eigen::Vector3f> points,
                                              std::span<const float> tolerance) const {
  std::vector<render::SurfaceHit> hits(points.size());
  rays_.nearest(points, hits);  // the direction to a point has the point's own length: it lies at distance 1
  std::vector<std::uint8_t> result(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    result[i] = hits[i].found() && (1.0F - hits[i].distance) * points[i].norm() > tolerance[i] ? 1 : 0;
  }
  return result;
}

}  // namespace q3d::pipeline::world
