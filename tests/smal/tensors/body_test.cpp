#include "smal/tensors/body.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smal/tensors/rotation.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::smal::tensors {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

SmalAsset good_asset() {
  return testing::load_parity_asset(testing::parity_dir());
}

struct Arguments {
  torch::Tensor rotations, betas, transl;
};

Arguments random_arguments(std::int64_t batch, torch::ScalarType dtype) {
  at::manual_seed(11);
  return {axis_angle_to_matrix_exact(0.4 * torch::randn({batch, kNumJoints, 3}, dtype)),
          0.5 * torch::randn({batch, kNumBetas}, dtype), torch::randn({batch, 3}, dtype)};
}

torch::Tensor identity_rotations(std::int64_t batch) {
  return torch::eye(3).expand({batch, kNumJoints, 3, 3}).contiguous();
}

double worst(const torch::Tensor& a, const torch::Tensor& b) {
  return (a - b).abs().max().item<double>();
}

TEST(SmalBody, RestPoseIsTheTemplate) {
  const SmalBody body(good_asset());
  const BodyOutput rest = body.forward(identity_rotations(1), torch::zeros({1, kNumBetas}));
  EXPECT_LT(worst(rest.vertices[0], body.asset().v_template), 1e-6);
}

TEST(SmalBody, GlobalRotationTurnsTheWholeBodyAboutTheRoot) {
  const SmalBody body(good_asset());
  torch::Tensor rotations = identity_rotations(1);
  const torch::Tensor turn = axis_angle_to_matrix_exact(torch::tensor({0.3f, -0.7f, 1.1f}));
  rotations[0][0].copy_(turn);
  const torch::Tensor betas = torch::zeros({1, kNumBetas});
  const torch::Tensor root = body.forward(identity_rotations(1), betas).joints[0][0];
  const torch::Tensor expected = torch::matmul(body.asset().v_template - root, turn.t()) + root;
  EXPECT_LT(worst(body.forward(rotations, betas).vertices[0], expected), 2e-6);
}

TEST(SmalBody, KeypointsAloneEqualThoseOfTheWholeBody) {
  const SmalBody body(good_asset());
  const Arguments at = random_arguments(3, torch::kFloat32);
  const BodyOutput whole = body.forward(at.rotations, at.betas, at.transl);
  EXPECT_LT(worst(body.keypoints(at.rotations, at.betas, at.transl), whole.keypoints), 1e-6);
  EXPECT_LT(worst(body.keypoints(at.rotations, at.betas) + at.transl.unsqueeze(1), whole.keypoints), 1e-6);
}

TEST(SmalBody, DoublePrecisionAgreesWithSingle) {
  const SmalBody body(good_asset());
  const Arguments at = random_arguments(2, torch::kFloat64);
  const BodyOutput exact = body.to_dtype(torch::kFloat64).forward(at.rotations, at.betas, at.transl);
  EXPECT_EQ(exact.vertices.scalar_type(), torch::kFloat64);
  const BodyOutput single = body.forward(at.rotations.to(torch::kFloat32), at.betas.to(torch::kFloat32),
                                         at.transl.to(torch::kFloat32));
  EXPECT_LT(worst(single.vertices, exact.vertices), 1e-5);
  EXPECT_LT(worst(single.joints, exact.joints), 1e-5);
}

// Gradients of a weighted sum against central differences, in double precision.
TEST(SmalBody, GradientsMatchFiniteDifferences) {
  const SmalBody body = SmalBody(good_asset()).to_dtype(torch::kFloat64);
  at::manual_seed(5);
  torch::Tensor axis_angle = (0.4 * torch::randn({1, kNumJoints, 3}, torch::kFloat64)).requires_grad_();
  torch::Tensor betas = (0.5 * torch::randn({1, kNumBetas}, torch::kFloat64)).requires_grad_();
  torch::Tensor transl = torch::randn({1, 3}, torch::kFloat64).requires_grad_();
  const torch::Tensor weights = torch::randn({1, kNumKeypoints, 3}, torch::kFloat64);
  const torch::Tensor vertex_weights = torch::randn({1, kNumVertices, 3}, torch::kFloat64) / 100;
  const auto loss = [&] {
    const torch::Tensor rotations = axis_angle_to_matrix_exact(axis_angle);
    return (body.keypoints(rotations, betas, transl) * weights).sum() +
           (body.forward(rotations, betas, transl).vertices * vertex_weights).sum();
  };
  loss().backward();
  const at::NoGradGuard no_grad;
  constexpr double kStep = 1e-5;
  for (torch::Tensor* input : {&axis_angle, &betas, &transl}) {
    torch::Tensor flat = input->view(-1);
    const torch::Tensor gradient = input->grad().view(-1);
    for (std::int64_t i = 0; i < flat.size(0); i += 7) {
      const double kept = flat[i].item<double>();
      flat[i] = kept + kStep;
      const double above = loss().item<double>();
      flat[i] = kept - kStep;
      const double below = loss().item<double>();
      flat[i] = kept;
      EXPECT_NEAR(gradient[i].item<double>(), (above - below) / (2 * kStep), 1e-6) << "element " << i;
    }
  }
}

TEST(SmalBody, RefusesOtherShapes) {
  const SmalBody body(good_asset());
  const torch::Tensor rotations = identity_rotations(2), betas = torch::zeros({2, kNumBetas});
  EXPECT_THROW(body.forward(rotations.narrow(1, 0, 34), betas), std::invalid_argument);
  EXPECT_THROW(body.forward(rotations, torch::zeros({2, 20})), std::invalid_argument);
  EXPECT_THROW(body.keypoints(rotations, torch::zeros({1, kNumBetas})), std::invalid_argument);
  EXPECT_THROW(body.keypoints(rotations, betas, torch::zeros({2, 2})), std::invalid_argument);
}

TEST(SmalAsset, SurvivesAFile) {
  const testing::ScratchDir scratch;
  SmalAsset asset = good_asset();
  asset.name = "a \"name\"";
  asset.licence = "a licence";
  save_asset(scratch.path() / "asset.safetensors", asset);
  const SmalAsset again = load_asset(scratch.path() / "asset.safetensors");
  EXPECT_EQ(again.name, asset.name);
  EXPECT_EQ(again.licence, asset.licence);
  EXPECT_EQ(again.keypoint_vertices, asset.keypoint_vertices);
  for (const auto member :
       {&SmalAsset::v_template, &SmalAsset::faces, &SmalAsset::shapedirs, &SmalAsset::posedirs,
        &SmalAsset::j_regressor, &SmalAsset::lbs_weights, &SmalAsset::parents}) {
    EXPECT_TRUE(torch::equal(again.*member, asset.*member));
  }
}

TEST(SmalAsset, RefusesAFileOfAnotherKind) {
  EXPECT_THAT([] { load_asset(testing::parity_dir() / "smal.safetensors"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("not a SMAL asset")));
}

// Each row spoils one thing of a good asset.
struct Damage {
  const char* reason;
  void (*apply)(SmalAsset&);
};

class DamagedAsset : public ::testing::TestWithParam<Damage> {};

TEST_P(DamagedAsset, IsRefusedByName) {
  SmalAsset asset = good_asset();
  for (torch::Tensor* tensor : {&asset.v_template, &asset.parents, &asset.lbs_weights, &asset.j_regressor}) {
    *tensor = tensor->clone();  // other tests share them
  }
  GetParam().apply(asset);
  EXPECT_THAT([&] { check_asset(asset, "the file"); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("the file"), HasSubstr(GetParam().reason))));
}

TEST(SmalAsset, AcceptsTheGoldenOne) {
  EXPECT_NO_THROW(check_asset(good_asset(), "test"));
}

INSTANTIATE_TEST_SUITE_P(
    Everything, DamagedAsset,
    ::testing::Values(
        Damage{"cycle", [](SmalAsset& a) { a.parents[5] = 9; }},
        Damage{"cycle", [](SmalAsset& a) { a.parents[5] = 5; }},
        Damage{"a parent must come before its child",
               [](SmalAsset& a) {
                 a.parents[15] = 16;
                 a.parents[16] = 6;
               }},
        Damage{"parents[0] is 0", [](SmalAsset& a) { a.parents[0] = 0; }},
        Damage{"parents[3] is -1", [](SmalAsset& a) { a.parents[3] = -1; }},
        Damage{"parents[3] is 35", [](SmalAsset& a) { a.parents[3] = 35; }},
        Damage{"row 7 of lbs_weights", [](SmalAsset& a) { a.lbs_weights[7] *= 1.1; }},
        Damage{"row 4 of j_regressor", [](SmalAsset& a) { a.j_regressor[4] *= 0.9; }},
        Damage{"v_template holds a number that is not finite",
               [](SmalAsset& a) { a.v_template[1][1] = NAN; }},
        Damage{"posedirs holds a number", [](SmalAsset& a) { a.posedirs[305][11666] = INFINITY; }},
        Damage{"v_template is not a (V, 3) tensor", [](SmalAsset& a) { a.v_template = torch::Tensor(); }},
        Damage{"shapedirs is missing", [](SmalAsset& a) { a.shapedirs = torch::Tensor(); }},
        Damage{"shapedirs is Float (3889, 3, 40)",
               [](SmalAsset& a) { a.shapedirs = a.shapedirs.narrow(2, 0, 40); }},
        Damage{"posedirs is Float (11667, 306)", [](SmalAsset& a) { a.posedirs = a.posedirs.t(); }},
        Damage{"v_template is Double", [](SmalAsset& a) { a.v_template = a.v_template.to(torch::kFloat64); }},
        Damage{"lbs_weights is Float (3888, 35)",
               [](SmalAsset& a) { a.lbs_weights = a.lbs_weights.slice(0, 1); }},
        Damage{"faces holds index 3889", [](SmalAsset& a) { a.faces[0][0] = 3889; }},
        Damage{"faces holds index -2", [](SmalAsset& a) { a.faces[9][2] = -2; }},
        Damage{"faces is empty", [](SmalAsset& a) { a.faces = a.faces.narrow(0, 0, 0); }},
        Damage{"25 keypoint groups", [](SmalAsset& a) { a.keypoint_vertices.pop_back(); }},
        Damage{"keypoint 3 has no vertices", [](SmalAsset& a) { a.keypoint_vertices[3].clear(); }},
        Damage{"keypoint 2 has vertex 3889", [](SmalAsset& a) { a.keypoint_vertices[2] = {3889}; }}));

}  // namespace
}  // namespace q3d::smal::tensors
