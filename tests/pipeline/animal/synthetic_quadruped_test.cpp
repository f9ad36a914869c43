#include "pipeline/animal/synthetic_quadruped.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <set>

#include "pipeline/animal/synthetic_mesh.h"
#include "pipeline/animal/synthetic_prior.h"
#include "pipeline/animal/synthetic_shapes.h"
#include "smal/tensors/body.h"
#include "smal/tensors/rotation.h"

namespace q3d::pipeline::animal {
namespace {

constexpr std::int64_t kFamilyCount = 5;

const smal::tensors::SmalAsset& asset() {
  static const smal::tensors::SmalAsset made = make_synthetic_quadruped();
  return made;
}

const smal::tensors::SmalBody& body() {
  static const smal::tensors::SmalBody made(asset());
  return made;
}

torch::Tensor rest_rotations(std::int64_t batch) {
  return torch::eye(3).expand({batch, smal::kNumJoints, 3, 3}).contiguous();
}

// The five family means in rest pose.
const smal::tensors::BodyOutput& families() {
  static const smal::tensors::BodyOutput made =
      body().forward(rest_rotations(kFamilyCount), synthetic_family_means());
  return made;
}

// (B, V, 3) -> (B): signed volume by the divergence theorem, positive when the faces look outwards.
torch::Tensor volume(const torch::Tensor& vertices) {
  const torch::Tensor corners = vertices.to(torch::kFloat64)
                                    .index_select(1, asset().faces.flatten().to(torch::kInt64))
                                    .unflatten(1, {smal::kNumFaces, 3});
  const torch::Tensor normal = torch::linalg_cross(corners.select(2, 1), corners.select(2, 2));
  return (corners.select(2, 0) * normal).sum({1, 2}) / 6.0;
}

torch::Tensor mirror_index() {
  return torch::tensor(
      std::vector<std::int64_t>(synthetic_mesh().mirror.begin(), synthetic_mesh().mirror.end()));
}

TEST(SyntheticQuadruped, PassesTheAssetChecksAtSmalsSizes) {
  ASSERT_NO_THROW(smal::tensors::check_asset(asset(), "synthetic"));
  EXPECT_EQ(asset().v_template.size(0), smal::kNumVertices);
  EXPECT_EQ(asset().faces.size(0), smal::kNumFaces);
  EXPECT_GE(asset().lbs_weights.min().item<float>(), 0.0f);
  EXPECT_GE(asset().j_regressor.min().item<float>(), 0.0f);
}

TEST(SyntheticQuadruped, IsOneClosedSurfaceWithoutHandles) {
  std::map<std::pair<int, int>, int> directed_edges;
  const auto face = asset().faces.accessor<std::int32_t, 2>();
  for (std::int64_t f = 0; f < smal::kNumFaces; ++f) {
    for (int corner = 0; corner < 3; ++corner) ++directed_edges[{face[f][corner], face[f][(corner + 1) % 3]}];
  }
  std::vector<int> label(smal::kNumVertices);
  std::iota(label.begin(), label.end(), 0);
  const auto find = [&label](int v) {
    while (label[static_cast<std::size_t>(v)] != v) v = label[static_cast<std::size_t>(v)];
    return v;
  };
  for (const auto& [edge, count] : directed_edges) {
    ASSERT_EQ(count, 1) << "edge " << edge.first << " " << edge.second << " has two faces on one side";
    ASSERT_TRUE(directed_edges.count({edge.second, edge.first})) << "edge with one face only";
    label[static_cast<std::size_t>(find(edge.first))] = find(edge.second);
  }
  std::set<int> pieces;
  for (int v = 0; v < smal::kNumVertices; ++v) pieces.insert(find(v));
  EXPECT_EQ(pieces.size(), 1u);
  const auto edges = static_cast<std::int64_t>(directed_edges.size() / 2);
  EXPECT_EQ(smal::kNumVertices - edges + smal::kNumFaces, 2);  // Euler's formula for genus 0
}

TEST(SyntheticQuadruped, FacesLookOutwards) {
  EXPECT_GT(volume(families().vertices).min().item<double>(), 0.02);
}

TEST(SyntheticQuadruped, IsItsOwnMirrorImage) {
  const torch::Tensor mirror = mirror_index();
  const torch::Tensor flip = torch::tensor({1.0f, 1.0f, -1.0f});
  EXPECT_TRUE(torch::equal(asset().v_template.index_select(0, mirror) * flip, asset().v_template));
  const torch::Tensor directions = asset().shapedirs;
  const torch::Tensor mirrored = directions.index_select(0, mirror) * flip.view({1, 3, 1});
  EXPECT_LT((mirrored - directions).abs().max().item<float>(), 1e-7f);
  // Joints 7-10 and 11-14, 17-20 and 21-24, 33 and 34 are twins.
  std::vector<std::int64_t> twin(smal::kNumJoints);
  std::iota(twin.begin(), twin.end(), 0);
  for (const int left : {7, 8, 9, 10, 17, 18, 19, 20}) std::swap(twin[left], twin[left + 4]);
  std::swap(twin[33], twin[34]);
  const torch::Tensor swapped =
      asset().lbs_weights.index_select(0, mirror).index_select(1, torch::tensor(twin));
  EXPECT_LT((swapped - asset().lbs_weights).abs().max().item<float>(), 1e-6f);
}

TEST(SyntheticQuadruped, KeypointsAreOnTheirSides) {
  // The pairs (left, right) follow from the order of the datasets' 26 keypoints.
  const std::vector<std::pair<int, int>> pairs = {{0, 1},   {3, 4},   {5, 6},   {8, 9},   {10, 11},
                                                  {12, 13}, {14, 15}, {16, 17}, {20, 21}, {22, 23}};
  const std::vector<int> middle = {2, 7, 18, 19, 24, 25};
  const auto k = families().keypoints.accessor<float, 3>();
  for (int f = 0; f < kFamilyCount; ++f) {
    for (const auto& [left, right] : pairs) {
      EXPECT_LT(k[f][left][2], -0.01f) << left;
      EXPECT_NEAR(k[f][right][2], -k[f][left][2], 1e-5f);
      EXPECT_NEAR(k[f][right][0], k[f][left][0], 1e-5f);
    }
    for (const int point : middle) EXPECT_NEAR(k[f][point][2], 0.0f, 1e-5f) << point;
    // x: tail tip, tail middle, tail base, shoulder, neck, eye, nose; y: ground, carpus, shoulder.
    EXPECT_LT(k[f][19][0], k[f][25][0]);
    EXPECT_LT(k[f][25][0], k[f][7][0]);
    EXPECT_LT(k[f][7][0], k[f][12][0]);
    EXPECT_LT(k[f][12][0], k[f][18][0]);
    EXPECT_LT(k[f][18][0], k[f][0][0]);
    EXPECT_LT(k[f][0][0], k[f][24][0]);
    EXPECT_LT(k[f][3][1], k[f][14][1]);
    EXPECT_LT(k[f][14][1], k[f][8][1]);
    EXPECT_LT(k[f][8][1], k[f][12][1]);
    EXPECT_LT(k[f][2][1], k[f][24][1]);
    EXPECT_LT(k[f][22][1], k[f][20][1]);
  }
}

// The synthetic template has its keypoints near those of SMAL's template (x, y; model units), so it is a body
// of the same scale in the same axes.
TEST(SyntheticQuadruped, TemplateStandsWhereSmalsDoes) {
  const std::map<int, std::pair<double, double>> smal = {
      {4, {0.449, -0.461}},   {6, {-0.331, -0.525}}, {7, {-0.567, 0.209}},  {9, {0.317, -0.024}},
      {11, {-0.425, -0.133}}, {13, {0.321, 0.250}},  {15, {0.353, -0.351}}, {17, {-0.471, -0.293}},
      {18, {0.527, 0.316}},   {24, {0.922, 0.231}}};
  const torch::Tensor keypoints = body().keypoints(rest_rotations(1), torch::zeros({1, smal::kNumBetas}))[0];
  for (const auto& [point, place] : smal) {
    EXPECT_NEAR(keypoints[point][0].item<double>(), place.first, 0.13) << point;
    EXPECT_NEAR(keypoints[point][1].item<double>(), place.second, 0.13) << point;
  }
}

TEST(SyntheticQuadruped, FamiliesDifferAsAnimalsDo) {
  enum { kCat, kDog, kHorse, kCow, kHippo };
  const torch::Tensor joints = families().joints, keypoints = families().keypoints;
  const auto bone = [&](int a, int b) { return (joints.select(1, a) - joints.select(1, b)).norm(2, 1); };
  const torch::Tensor trunk = bone(0, 6);
  const auto ratios = [&](const torch::Tensor& length) {
    const torch::Tensor ratio = (length / trunk).contiguous();
    return std::vector<float>(ratio.data_ptr<float>(), ratio.data_ptr<float>() + kFamilyCount);
  };
  const auto leg = ratios(bone(8, 9) + bone(9, 10));
  EXPECT_GT(leg[kHorse], 1.1f * leg[kDog]);
  EXPECT_GT(leg[kDog], 1.1f * leg[kCow]);
  EXPECT_GT(leg[kCow], 1.2f * leg[kHippo]);
  const auto neck = ratios(bone(15, 16));
  EXPECT_GT(neck[kHorse], 1.5f * neck[kDog]);
  EXPECT_GT(neck[kDog], 1.2f * neck[kCat]);
  EXPECT_GT(neck[kCat], 1.1f * neck[kHippo]);
  const auto muzzle =
      ratios((keypoints.select(1, 24) - (keypoints.select(1, 0) + keypoints.select(1, 1)) / 2).norm(2, 1));
  EXPECT_GT(muzzle[kDog], 1.3f * muzzle[kCat]);
  EXPECT_GT(muzzle[kHorse], 1.2f * muzzle[kDog]);
  // Depth plus width of the belly's ring.
  const auto& belly = synthetic_mesh().rings_of(Part::body)[19];
  const auto vertex = [&](std::size_t side) { return families().vertices.select(1, belly[side]); };
  const auto girth = ratios((vertex(0) - vertex(16)).norm(2, 1) + (vertex(8) - vertex(24)).norm(2, 1));
  EXPECT_GT(girth[kHippo], 1.1f * girth[kCow]);
  EXPECT_GT(girth[kCow], 1.1f * girth[kHorse]);
  EXPECT_GT(girth[kHorse], 1.1f * girth[kDog]);
}

TEST(SyntheticQuadruped, ShapeDirectionsShrinkAndAreIndependent) {
  const torch::Tensor directions = asset().shapedirs.to(torch::kFloat64).flatten(0, 1);
  const torch::Tensor gram = torch::matmul(directions.t(), directions);
  const torch::Tensor sizes = gram.diagonal().sqrt();
  EXPECT_TRUE((sizes.slice(0, 0, smal::kNumBetas - 1) >= sizes.slice(0, 1) - 1e-9).all().item<bool>());
  EXPECT_GT(sizes[smal::kNumBetas - 1].item<double>(), 0.0);
  const torch::Tensor cosines =
      gram / sizes.unsqueeze(0) / sizes.unsqueeze(1) - torch::eye(smal::kNumBetas, torch::kFloat64);
  EXPECT_LT(cosines.abs().max().item<double>(), 1e-3);
}

// 41 directions hold the five animals that they were made from.
TEST(SyntheticQuadruped, BetasReproduceTheFamilies) {
  for (std::size_t f = 0; f < kNumFamilies; ++f) {
    const Points animal = embed_quadruped(synthetic_mesh(), family_anatomy(f));
    const auto vertices = families().vertices[static_cast<std::int64_t>(f)].to(torch::kFloat64);
    const torch::Tensor designed =
        torch::from_blob(const_cast<double*>(animal.data()), {smal::kNumVertices, 3}, torch::kFloat64);
    EXPECT_LT((vertices - designed).abs().max().item<double>(), 2e-3) << f;
  }
}

// A folded elbow keeps its thickness: plain skinning loses about a third at the crease.
TEST(SyntheticQuadruped, PoseBlendShapesKeepAFoldedJointThick) {
  constexpr int kElbow = 12, kElbowRing = 3;
  torch::Tensor pose = torch::zeros({1, smal::kNumJoints, 3});
  pose[0][kElbow][2] = 1.5;
  const torch::Tensor rotations = smal::tensors::axis_angle_to_matrix_exact(pose);
  const torch::Tensor betas = torch::zeros({1, smal::kNumBetas});
  smal::tensors::SmalAsset plain = asset();
  plain.posedirs = torch::zeros_like(plain.posedirs);
  const auto& ring = synthetic_mesh().rings_of(Part::right_foreleg)[kElbowRing];
  const torch::Tensor index = torch::tensor(std::vector<std::int64_t>(ring.begin(), ring.end()));
  const auto thickness = [&](const torch::Tensor& vertices) {
    const torch::Tensor points = vertices[0].index_select(0, index);
    return (points - points.mean(0)).norm(2, 1).mean().item<double>();
  };
  const double rest = thickness(asset().v_template.unsqueeze(0));
  const double corrected = thickness(body().forward(rotations, betas).vertices);
  const double uncorrected = thickness(smal::tensors::SmalBody(plain).forward(rotations, betas).vertices);
  EXPECT_GT(corrected, 0.85 * rest);
  EXPECT_GT(corrected, uncorrected + 0.05 * rest);
}

TEST(SyntheticQuadruped, PosedAnimalsKeepTheirVolume) {
  std::mt19937_64 random(17);
  std::vector<torch::Tensor> poses, betas;
  for (int i = 0; i < 50; ++i) {
    poses.push_back(sample_pose(random));
    betas.push_back(sample_betas(i % kFamilyCount, random));
  }
  const torch::Tensor shape = torch::stack(betas);
  const torch::Tensor posed =
      volume(body().forward(smal::tensors::axis_angle_to_matrix_exact(torch::stack(poses)), shape).vertices);
  const torch::Tensor rest = volume(body().forward(rest_rotations(50), shape).vertices);
  const torch::Tensor ratio = posed / rest;
  EXPECT_GT(ratio.min().item<double>(), 0.9);
  EXPECT_LT(ratio.max().item<double>(), 1.1);
}

TEST(SyntheticQuadruped, BytesDoNotDependOnTheCallOrTheThreads) {
  const int threads = at::get_num_threads();
  std::vector<ShapeSpace> spaces;
  std::vector<smal::tensors::SmalAsset> assets;
  for (const int count : {1, 2}) {
    at::set_num_threads(count);
    spaces.push_back(make_shape_space(make_quadruped_mesh()));
    assets.push_back(make_synthetic_quadruped());
  }
  at::set_num_threads(threads);
  EXPECT_EQ(spaces[0].mean, spaces[1].mean);
  EXPECT_EQ(spaces[0].directions, spaces[1].directions);
  EXPECT_EQ(spaces[0].family_means, spaces[1].family_means);
  for (const auto member : {&smal::tensors::SmalAsset::v_template, &smal::tensors::SmalAsset::shapedirs,
                            &smal::tensors::SmalAsset::posedirs, &smal::tensors::SmalAsset::j_regressor,
                            &smal::tensors::SmalAsset::lbs_weights, &smal::tensors::SmalAsset::faces}) {
    EXPECT_TRUE(torch::equal(assets[0].*member, assets[1].*member));
  }
}

}  // namespace
}  // namespace q3d::pipeline::animal
