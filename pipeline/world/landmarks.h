// Gives the keypoints of the datasets as places on the body: SMAL's own 26, and the points that only
// SuperAnimal's 39 or Animal Kingdom's 23 have.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "pipeline/world/bodies.h"

namespace q3d::pipeline::world {

struct Landmark {
  std::string name;    // as the dataset spells it
  int keypoint = -1;   // one of SMAL's 26, or
  int vertex = -1;     // a vertex of the mesh; both -1: no animal of this world has it (antlers)
  int mirror = 0;      // index of the left-right partner, itself when it has none
  float depth = 0.0F;  // how far under the skin it may lie, SMAL units
  bool vague = false;  // on smooth skin, where people disagree most
  bool exists() const { return keypoint >= 0 || vertex >= 0; }
};

std::vector<Landmark> animal3d_landmarks(const RestMesh& rest);        // 26
std::vector<Landmark> superanimal_landmarks(const RestMesh& rest);     // 39
std::vector<Landmark> animal_kingdom_landmarks(const RestMesh& rest);  // 23

// Returns the positions of the landmarks on a body, in the camera frame without translation. A landmark that
// does not exist is at (0, 0, 0).
std::vector<Eigen::Vector3f> landmark_points(const std::vector<Landmark>& landmarks, const Body& body);

}  // namespace q3d::pipeline::world
