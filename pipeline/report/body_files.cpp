#include "pipeline/report/body_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>

#include "pipeline/run/version.h"
#include "smal/camera.h"

namespace q3d::pipeline::report {
namespace {

using Faces = std::span<const std::array<std::int32_t, 3>>;
using nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "glTF is little-endian");

// Changes from the crop camera's axes to those of 3D programs. This is half a turn about x, which keeps faces
// as they are.
Eigen::Vector3f turned(const Eigen::Vector3f& vertex) {
  return {vertex.x(), -vertex.y(), -vertex.z()};
}

// Replaces line feeds, which would end a comment.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return text;
}

ordered_json camera_numbers(const PhotoBody& body) {
  return {{"id", body.id},
          {"body", body.kind},
          {"focal_px", smal::kFocalInCropUnits * body.box.side_px},
          {"principal_point_px", {body.box.center_x_px, body.box.center_y_px}},
          {"crop_side_px", body.box.side_px}};
}

void append(std::vector<std::byte>& bytes, const void* data, std::size_t count) {
  const auto* first = static_cast<const std::byte*>(data);
  bytes.insert(bytes.end(), first, first + count);
}

void append_number(std::vector<std::byte>& bytes, std::uint32_t number) {
  append(bytes, &number, sizeof(number));
}

// Appends a chunk, padded because the size of a GLB chunk is a multiple of 4 bytes.
void append_chunk(std::vector<std::byte>& file, std::uint32_t type, std::vector<std::byte> content,
                  char filler) {
  content.resize((content.size() + 3) / 4 * 4, static_cast<std::byte>(filler));
  append_number(file, static_cast<std::uint32_t>(content.size()));
  append_number(file, type);
  append(file, content.data(), content.size());
}

// Numbers of the glTF 2.0 specification.
constexpr int kFloat = 5126, kUnsignedInt = 5125, kArrayBuffer = 34962, kElementArrayBuffer = 34963;

ordered_json scene(const PhotoBody& body, std::size_t faces, const Eigen::AlignedBox3f& extent) {
  const std::size_t vertices = body.vertices->size();
  const std::size_t vertex_bytes = vertices * 12, face_bytes = faces * 12;
  const auto numbers = [](const Eigen::Vector3f& point) {
    return ordered_json{point.x(), point.y(), point.z()};
  };
  ordered_json document = {
      {"asset", {{"version", "2.0"}, {"generator", "quadruped3d " + std::string(run::version())}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0, 1}}}}},
      {"nodes", {{{"name", "body"}, {"mesh", 0}}, {{"name", "crop camera"}, {"camera", 0}}}},
      {"cameras",
       {{{"type", "perspective"},
         {"perspective",
          {{"aspectRatio", 1.0},
           {"yfov", 2.0 * std::atan(0.5 / smal::kFocalInCropUnits)},
           {"znear", 0.01}}}}}},
      {"materials",
       {{{"doubleSided", true},
         {"pbrMetallicRoughness",
          {{"baseColorFactor", {0.94, 0.62, 0.0, 1.0}},
           {"metallicFactor", 0.0},
           {"roughnessFactor", 0.8}}}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}, {"material", 0}}}}}}},
      {"accessors",
       {{{"bufferView", 0},
         {"componentType", kFloat},
         {"count", vertices},
         {"type", "VEC3"},
         {"min", numbers(extent.min())},
         {"max", numbers(extent.max())}},
        {{"bufferView", 1}, {"componentType", kUnsignedInt}, {"count", 3 * faces}, {"type", "SCALAR"}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", vertex_bytes}, {"target", kArrayBuffer}},
        {{"buffer", 0},
         {"byteOffset", vertex_bytes},
         {"byteLength", face_bytes},
         {"target", kElementArrayBuffer}}}},
      {"buffers", {{{"byteLength", vertex_bytes + face_bytes}}}}};
  document["asset"]["extras"] = camera_numbers(body);
  return document;
}

}  // namespace

std::string obj_text(const PhotoBody& body, Faces faces) {
  std::string text = fmt::format(
      "# {}\n# body: {}\n# axes: x right, y up, z towards the viewer; the photograph's camera is at the "
      "origin\n# focal_px {}\n# principal_point_px {} {}\n# crop_side_px {}\n",
      one_line(body.id), body.kind, smal::kFocalInCropUnits * body.box.side_px, body.box.center_x_px,
      body.box.center_y_px, body.box.side_px);
  for (const Eigen::Vector3f& vertex : *body.vertices) {
    const Eigen::Vector3f point = turned(vertex);
    fmt::format_to(std::back_inserter(text), "v {} {} {}\n", point.x(), point.y(), point.z());
  }
  for (const auto& face : faces) {
    fmt::format_to(std::back_inserter(text), "f {} {} {}\n", face[0] + 1, face[1] + 1, face[2] + 1);
  }
  return text;
}

std::vector<std::byte> glb_bytes(const PhotoBody& body, Faces faces) {
  std::vector<std::byte> buffer;
  Eigen::AlignedBox3f extent;
  for (const Eigen::Vector3f& vertex : *body.vertices) {
    const Eigen::Vector3f point = turned(vertex);
    extent.extend(point);
    append(buffer, point.data(), 3 * sizeof(float));
  }
  for (const auto& face : faces) append(buffer, face.data(), sizeof(face));
  // Ids may hold any bytes, but JSON text must be UTF-8.
  const std::string json =
      scene(body, faces.size(), extent).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::vector<std::byte> header;
  append(header, json.data(), json.size());

  constexpr std::uint32_t kMagic = 0x46546C67, kJson = 0x4E4F534A, kBin = 0x004E4942;
  std::vector<std::byte> chunks;
  append_chunk(chunks, kJson, std::move(header), ' ');
  append_chunk(chunks, kBin, std::move(buffer), '\0');
  std::vector<std::byte> file;
  append_number(file, kMagic);
  append_number(file, 2);
  append_number(file, static_cast<std::uint32_t>(12 + chunks.size()));
  append(file, chunks.data(), chunks.size());
  return file;
}

}  // namespace q3d::pipeline::report
