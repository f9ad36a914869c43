#include "pipeline/report/body_files.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <cstring>
#include <sstream>

namespace q3d::pipeline::report {
namespace {

const std::vector<std::array<std::int32_t, 3>> kFaces{{0, 1, 2}, {2, 1, 3}};
const Vertices kVertices{
    {0.5F, -0.25F, 10.0F}, {1.0F, 0.75F, 9.5F}, {-0.5F, 0.1F, 10.5F}, {0.0F, 0.0F, 11.0F}};

PhotoBody body() {
  return {
      "zoo/a.jpg#1", "refined", &kVertices, {.center_x_px = 300.0, .center_y_px = 200.0, .side_px = 512.0}};
}

// The photograph's pixel of a vertex by the crop's camera: focal 1000 px in 256 px.
std::array<double, 2> pixel(const Eigen::Vector3f& vertex) {
  return {300.0 + 512.0 * 1000.0 / 256.0 * vertex.x() / vertex.z(),
          200.0 + 512.0 * 1000.0 / 256.0 * vertex.y() / vertex.z()};
}

TEST(ObjText, HasTheAssetsOrderAndTheStatedCamera) {
  std::istringstream text(obj_text(body(), kFaces));
  std::string line, word;
  double focal = 0, cx = 0, cy = 0;
  Vertices vertices;
  std::vector<std::array<std::int32_t, 3>> faces;
  while (std::getline(text, line)) {
    std::istringstream words(line);
    words >> word;
    if (word == "#") {
      words >> word;
      if (word == "focal_px") words >> focal;
      if (word == "principal_point_px") words >> cx >> cy;
    } else if (word == "v") {
      Eigen::Vector3f& vertex = vertices.emplace_back();
      words >> vertex.x() >> vertex.y() >> vertex.z();
    } else if (word == "f") {
      auto& face = faces.emplace_back();
      words >> face[0] >> face[1] >> face[2];
    }
  }
  ASSERT_EQ(vertices.size(), kVertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const auto [x, y] = pixel(kVertices[v]);
    EXPECT_NEAR(cx - focal * vertices[v].x() / vertices[v].z(), x, 1e-3);
    EXPECT_NEAR(cy + focal * vertices[v].y() / vertices[v].z(), y, 1e-3);
    EXPECT_LT(vertices[v].z(), 0.0F) << "before a camera that looks along -z";
  }
  ASSERT_EQ(faces.size(), kFaces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(faces[f][c], kFaces[f][c] + 1) << "OBJ counts from 1";
  }
}

TEST(ObjText, AnIdCannotEndItsComment) {
  PhotoBody hostile = body();
  hostile.id = "a\nv 1 2 3";
  EXPECT_EQ(obj_text(hostile, {}).find("\nv 1 2 3"), std::string::npos);
}

std::uint32_t number_at(const std::vector<std::byte>& bytes, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

TEST(GlbBytes, IsAGlbWithTheMeshAndTheCamera) {
  const std::vector<std::byte> file = glb_bytes(body(), kFaces);
  ASSERT_EQ(std::memcmp(file.data(), "glTF", 4), 0);
  EXPECT_EQ(number_at(file, 4), 2U);
  EXPECT_EQ(number_at(file, 8), file.size());
  const std::size_t json_bytes = number_at(file, 12);
  ASSERT_EQ(json_bytes % 4, 0U);
  ASSERT_EQ(std::memcmp(file.data() + 16, "JSON", 4), 0);
  const auto* text = reinterpret_cast<const char*>(file.data()) + 20;
  const nlohmann::json document = nlohmann::json::parse(text, text + json_bytes);
  const std::size_t bin = 20 + json_bytes;
  ASSERT_EQ(std::memcmp(file.data() + bin + 4, "BIN\0", 4), 0);
  EXPECT_EQ(number_at(file, bin), document["buffers"][0]["byteLength"]);

  std::array<float, 12> numbers{};
  std::memcpy(numbers.data(), file.data() + bin + 8, sizeof(numbers));
  for (std::size_t v = 0; v < kVertices.size(); ++v) {
    EXPECT_EQ(numbers[3 * v], kVertices[v].x());
    EXPECT_EQ(numbers[3 * v + 1], -kVertices[v].y());
    EXPECT_EQ(numbers[3 * v + 2], -kVertices[v].z());
  }
  std::array<std::uint32_t, 6> corners{};
  std::memcpy(corners.data(), file.data() + bin + 8 + sizeof(numbers), sizeof(corners));
  EXPECT_EQ(corners, (std::array<std::uint32_t, 6>{0, 1, 2, 2, 1, 3}));
  EXPECT_EQ(document["accessors"][0]["min"], (nlohmann::json{-0.5F, -0.75F, -11.0F}));
  EXPECT_EQ(document["accessors"][0]["max"], (nlohmann::json{1.0F, 0.25F, -9.5F}));
  EXPECT_EQ(document["asset"]["extras"]["focal_px"], 2000.0);
  // The crop is 256 px wide at focal 1000 px.
  EXPECT_NEAR(document["cameras"][0]["perspective"]["yfov"].get<double>(), 2.0 * std::atan(128.0 / 1000.0),
              1e-12);
}

}  // namespace
}  // namespace q3d::pipeline::report
