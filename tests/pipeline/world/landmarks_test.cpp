#include "pipeline/world/landmarks.h"

#include <gtest/gtest.h>

#include "loaders/keypoints/topology.h"

namespace q3d::pipeline::world {
namespace {

// The loaders' tables were written independently of ours.
void expect_topology(const std::vector<Landmark>& landmarks, const loaders::keypoints::Topology& topology) {
  ASSERT_EQ(landmarks.size(), topology.keypoints.size());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    EXPECT_EQ(landmarks[i].name, topology.keypoints[i]) << i;
    EXPECT_EQ(landmarks[i].mirror, topology.flip[i]) << landmarks[i].name;
  }
  for (std::size_t k = 0; k < topology.source.size(); ++k) {
    if (topology.source[k] < 0) continue;
    EXPECT_EQ(landmarks[static_cast<std::size_t>(topology.source[k])].keypoint, static_cast<int>(k))
        << topology.keypoints[static_cast<std::size_t>(topology.source[k])];
  }
}

class Landmarks : public ::testing::Test {
 protected:
  static const BodyModel& model() {
    static const BodyModel kModel;
    return kModel;
  }
};

TEST_F(Landmarks, NamesMirrorsAndMapsAgreeWithTheLoaders) {
  const RestMesh& rest = model().rest();
  expect_topology(animal3d_landmarks(rest), loaders::keypoints::topology("animal3d26"));
  expect_topology(superanimal_landmarks(rest), loaders::keypoints::topology("superanimal_quadruped39"));
  expect_topology(animal_kingdom_landmarks(rest), loaders::keypoints::topology("animal_kingdom23"));
}

TEST_F(Landmarks, MirrorPartnersLieOnOppositeSidesOfTheRestingBody) {
  const RestMesh& rest = model().rest();
  for (const auto& set :
       {animal3d_landmarks(rest), superanimal_landmarks(rest), animal_kingdom_landmarks(rest)}) {
    Body body;
    body.vertices = rest.vertices;
    for (std::size_t k = 0; k < body.keypoints.size(); ++k) {
      body.keypoints[k].setZero();
      for (const int v : rest.keypoint_vertices[k])
        body.keypoints[k] += rest.vertices[static_cast<std::size_t>(v)];
      body.keypoints[k] /= static_cast<float>(rest.keypoint_vertices[k].size());
    }
    const auto points = landmark_points(set, body);
    for (std::size_t i = 0; i < set.size(); ++i) {
      const Eigen::Vector3f& partner = points[static_cast<std::size_t>(set[i].mirror)];
      EXPECT_LT((points[i] - Eigen::Vector3f(partner.x(), partner.y(), -partner.z())).norm(), 0.05F)
          << set[i].name;
      const bool right = set[i].name.find("ight") != std::string::npos;  // z is the animal's right
      EXPECT_TRUE(!right || !set[i].exists() || points[i].z() > 0.005F) << set[i].name;
    }
  }
}

TEST_F(Landmarks, NoAnimalHasAntlers) {
  int missing = 0;
  for (const Landmark& landmark : superanimal_landmarks(model().rest())) {
    if (landmark.exists()) continue;
    ++missing;
    EXPECT_NE(landmark.name.find("antler"), std::string::npos);
  }
  EXPECT_EQ(missing, 4);
}

}  // namespace
}  // namespace q3d::pipeline::world
