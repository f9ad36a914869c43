#include "pipeline/world/landmarks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string_view>

namespace q3d::pipeline::world {
namespace {

// The names of SMAL's 26 keypoints in the tables below.
constexpr std::array<std::string_view, smal::kNumKeypoints> kBodyNames{"left_eye",
                                                                       "right_eye",
                                                                       "chin",
                                                                       "left_front_paw",
                                                                       "right_front_paw",
                                                                       "left_back_paw",
                                                                       "right_back_paw",
                                                                       "tail_base",
                                                                       "left_front_thigh",
                                                                       "right_front_thigh",
                                                                       "left_back_thigh",
                                                                       "right_back_thigh",
                                                                       "left_shoulder",
                                                                       "right_shoulder",
                                                                       "left_front_knee",
                                                                       "right_front_knee",
                                                                       "left_back_knee",
                                                                       "right_back_knee",
                                                                       "neck",
                                                                       "tail_tip",
                                                                       "left_ear",
                                                                       "right_ear",
                                                                       "left_mouth_corner",
                                                                       "right_mouth_corner",
                                                                       "nose",
                                                                       "tail_mid"};

struct NamedPlace {
  std::string_view name;   // the dataset's
  std::string_view place;  // a body keypoint, a place of SurfacePlaces, or "-"
};

constexpr std::array<NamedPlace, 39> kSuperAnimal{{
    {"nose", "nose"},
    {"upper_jaw", "upper_jaw"},
    {"lower_jaw", "chin"},
    {"mouth_end_right", "right_mouth_corner"},
    {"mouth_end_left", "left_mouth_corner"},
    {"right_eye", "right_eye"},
    {"right_earbase", "right_ear"},
    {"right_earend", "right_ear_end"},
    {"right_antler_base", "-"},
    {"right_antler_end", "-"},
    {"left_eye", "left_eye"},
    {"left_earbase", "left_ear"},
    {"left_earend", "left_ear_end"},
    {"left_antler_base", "-"},
    {"left_antler_end", "-"},
    {"neck_base", "neck"},
    {"neck_end", "neck_end"},
    {"throat_base", "throat_base"},
    {"throat_end", "throat_end"},
    {"back_base", "back_base"},
    {"back_end", "back_end"},
    {"back_middle", "back_middle"},
    {"tail_base", "tail_base"},
    {"tail_end", "tail_tip"},
    {"front_left_thai", "left_front_thigh"},
    {"front_left_knee", "left_front_knee"},
    {"front_left_paw", "left_front_paw"},
    {"front_right_thai", "right_front_thigh"},
    {"front_right_knee", "right_front_knee"},
    {"front_right_paw", "right_front_paw"},
    {"back_left_paw", "left_back_paw"},
    {"back_left_thai", "left_back_thigh"},
    {"back_right_thai", "right_back_thigh"},
    {"back_left_knee", "left_back_knee"},
    {"back_right_knee", "right_back_knee"},
    {"back_right_paw", "right_back_paw"},
    {"belly_bottom", "belly_bottom"},
    {"body_middle_right", "right_flank"},
    {"body_middle_left", "left_flank"},
}};

// Animal Kingdom counts the limbs from the body outwards: its wrist and ankle are the feet, its elbow and
// knee the middle joints, its hip lies on the line of the back.
constexpr std::array<NamedPlace, 23> kAnimalKingdom{{
    {"Head_Mid_Top", "head_top"},
    {"Eye_Left", "left_eye"},
    {"Eye_Right", "right_eye"},
    {"Mouth_Front_Top", "nose"},
    {"Mouth_Back_Left", "left_mouth_corner"},
    {"Mouth_Back_Right", "right_mouth_corner"},
    {"Mouth_Front_Bottom", "chin"},
    {"Shoulder_Left", "left_shoulder"},
    {"Shoulder_Right", "right_shoulder"},
    {"Elbow_Left", "left_front_knee"},
    {"Elbow_Right", "right_front_knee"},
    {"Wrist_Left", "left_front_paw"},
    {"Wrist_Right", "right_front_paw"},
    {"Torso_Mid_Back", "back_middle"},
    {"Hip_Left", "left_hip"},
    {"Hip_Right", "right_hip"},
    {"Knee_Left", "left_back_knee"},
    {"Knee_Right", "right_back_knee"},
    {"Ankle_Left", "left_back_paw"},
    {"Ankle_Right", "right_back_paw"},
    {"Tail_Top_Back", "tail_base"},
    {"Tail_Mid_Back", "tail_mid"},
    {"Tail_End_Back", "tail_tip"},
}};

int keypoint_named(std::string_view place) {
  const auto found = std::find(kBodyNames.begin(), kBodyNames.end(), place);
  return found == kBodyNames.end() ? -1 : static_cast<int>(found - kBodyNames.begin());
}

// Finds vertices of the resting mesh at places that SMAL's keypoints do not cover.
class SurfacePlaces {
 public:
  explicit SurfacePlaces(const RestMesh& rest) : rest_(rest) {
    for (std::size_t k = 0; k < keypoints_.size(); ++k) {
      keypoints_[k].setZero();
      for (const int vertex : rest.keypoint_vertices[k]) {
        keypoints_[k] += rest.vertices[static_cast<std::size_t>(vertex)];
      }
      keypoints_[k] /= static_cast<float>(rest.keypoint_vertices[k].size());
    }
    const float tail = at("tail_base").x(),
                withers = 0.5F * (at("left_shoulder").x() + at("right_shoulder").x());
    const float head = at("neck").x();
    const Eigen::Vector3f up = Eigen::Vector3f::UnitY(), right = Eigen::Vector3f::UnitZ();
    vertex_["back_base"] = extreme(withers, kTorso, up);
    vertex_["back_middle"] = extreme(0.5F * (withers + tail), kTorso, up);
    vertex_["back_end"] = extreme(tail + 0.2F * (withers - tail), kTorso, up);
    vertex_["belly_bottom"] = extreme(0.45F * withers + 0.55F * tail, kTorso, -up);
    vertex_["right_flank"] = extreme(0.5F * (withers + tail), kTorso, right);
    vertex_["left_flank"] = extreme(0.5F * (withers + tail), kTorso, -right);
    vertex_["neck_end"] = extreme(withers + 0.25F * (head - withers), kTorsoAndNeck, up);
    vertex_["throat_end"] = extreme(withers + 0.45F * (head - withers), kTorsoAndNeck, -up);
    vertex_["throat_base"] = extreme(head, kNeckAndHead, -up);
    vertex_["left_hip"] = nearest(at("left_back_thigh"), vertex_["back_end"]);
    vertex_["right_hip"] = nearest(at("right_back_thigh"), vertex_["back_end"]);
    vertex_["head_top"] = extreme(0.5F * (at("left_ear").x() + at("left_eye").x()), kHeadOnly, up);
    vertex_["upper_jaw"] = extreme(0.75F * at("nose").x() + 0.25F * at("left_eye").x(), kHeadOnly, up);
    vertex_["left_ear_end"] = farthest_of_joint(33);
    vertex_["right_ear_end"] = farthest_of_joint(34);
  }

  int vertex(std::string_view place) const {
    const auto found = vertex_.find(std::string(place));
    if (found == vertex_.end()) throw std::logic_error("landmarks: no place named " + std::string(place));
    return found->second;
  }

  float depth(int keypoint) const {
    float reach = 0.0F;
    for (const int vertex : rest_.keypoint_vertices[static_cast<std::size_t>(keypoint)]) {
      reach = std::max(reach, (rest_.vertices[static_cast<std::size_t>(vertex)] -
                               keypoints_[static_cast<std::size_t>(keypoint)])
                                  .norm());
    }
    return reach;
  }

 private:
  struct Joints {
    int first, last;
  };
  static constexpr std::array<Joints, 1> kTorso{{{0, 6}}};
  static constexpr std::array<Joints, 2> kTorsoAndNeck{{{0, 6}, {15, 15}}};
  static constexpr std::array<Joints, 2> kNeckAndHead{{{15, 16}, {32, 32}}};
  static constexpr std::array<Joints, 1> kHeadOnly{{{16, 16}}};

  const Eigen::Vector3f& at(std::string_view name) const {
    return keypoints_[static_cast<std::size_t>(keypoint_named(name))];
  }

  template <std::size_t N>
  bool belongs(std::size_t vertex, const std::array<Joints, N>& parts) const {
    float sum = 0.0F;
    for (const Joints& part : parts) {
      for (int j = part.first; j <= part.last; ++j)
        sum += rest_.skinning[vertex][static_cast<std::size_t>(j)];
    }
    return sum > 0.5F;
  }

  // Returns the vertex of the parts that lies farthest along `direction` in the slice around x.
  template <std::size_t N>
  int extreme(float x, const std::array<Joints, N>& parts, const Eigen::Vector3f& direction) const {
    int best = -1;
    float best_score = -std::numeric_limits<float>::infinity();
    for (std::size_t v = 0; v < rest_.vertices.size(); ++v) {
      if (!belongs(v, parts)) continue;
      // One unit of distance from the slice costs as much as two units of reach, and the middle line is
      // preferred to the sides.
      const Eigen::Vector3f& p = rest_.vertices[v];
      const float side = direction.z() == 0.0F ? 0.5F * std::abs(p.z()) : 0.0F;
      const float score = direction.dot(p) - 2.0F * std::abs(p.x() - x) - side;
      if (score > best_score) {
        best_score = score;
        best = static_cast<int>(v);
      }
    }
    if (best < 0) throw std::logic_error("landmarks: the mesh lacks a body part");
    return best;
  }

  // Finds the vertex on the skin that lies to the side as `side` does, but at the height and length of the
  // vertex `level`.
  int nearest(const Eigen::Vector3f& side, int level) const {
    const Eigen::Vector3f& line = rest_.vertices[static_cast<std::size_t>(level)];
    const Eigen::Vector3f target(line.x(), line.y() - 0.05F, 0.6F * side.z());
    const auto found =
        std::min_element(rest_.vertices.begin(), rest_.vertices.end(), [&](const auto& a, const auto& b) {
          return (a - target).squaredNorm() < (b - target).squaredNorm();
        });
    return static_cast<int>(found - rest_.vertices.begin());
  }

  // Returns the tip of a limb that one joint moves, which is its vertex farthest from the head's middle.
  int farthest_of_joint(int joint) const {
    const Eigen::Vector3f from = 0.5F * (at("left_eye") + at("right_eye"));
    int best = -1;
    float best_distance = -1.0F;
    for (std::size_t v = 0; v < rest_.vertices.size(); ++v) {
      const float distance = (rest_.vertices[v] - from).norm();
      if (rest_.skinning[v][static_cast<std::size_t>(joint)] > 0.5F && distance > best_distance) {
        best_distance = distance;
        best = static_cast<int>(v);
      }
    }
    if (best < 0) throw std::logic_error("landmarks: the mesh has no ear");
    return best;
  }

  const RestMesh& rest_;
  std::array<Eigen::Vector3f, smal::kNumKeypoints> keypoints_;
  std::map<std::string, int> vertex_;
};

// Exchanges left and right in a name, whatever its case.
std::string mirrored(std::string name) {
  for (const auto& [from, to] : {std::pair<std::string_view, std::string_view>{"left", "right"},
                                 {"right", "left"},
                                 {"Left", "Right"},
                                 {"Right", "Left"}}) {
    const auto at = name.find(from);
    if (at != std::string::npos) return name.replace(at, from.size(), to);
  }
  return name;
}

// Returns whether people disagree about the place by several pixels, because no edge or colour tells where
// the point is.
bool is_vague(std::string_view place) {
  for (const std::string_view part : {"thigh", "shoulder", "neck", "throat", "back_base", "back_middle",
                                      "back_end", "belly", "flank", "hip", "tail_mid"}) {
    if (place.find(part) != std::string_view::npos) return true;
  }
  return false;
}

std::vector<Landmark> make_set(std::span<const NamedPlace> table, const RestMesh& rest) {
  const SurfacePlaces places(rest);
  std::vector<Landmark> set;
  for (const NamedPlace& row : table) {
    Landmark landmark{.name = std::string(row.name)};
    if (row.place != "-") {
      landmark.keypoint = keypoint_named(row.place);
      if (landmark.keypoint < 0) landmark.vertex = places.vertex(row.place);
      landmark.depth = 0.03F + (landmark.keypoint >= 0 ? places.depth(landmark.keypoint) : 0.0F);
      landmark.vague = is_vague(row.place);
    }
    set.push_back(std::move(landmark));
  }
  for (Landmark& landmark : set) {
    const std::string partner = mirrored(landmark.name);
    const auto found =
        std::find_if(set.begin(), set.end(), [&](const Landmark& l) { return l.name == partner; });
    landmark.mirror = static_cast<int>(found - set.begin());
  }
  return set;
}

}  // namespace

std::vector<Landmark> animal3d_landmarks(const RestMesh& rest) {
  std::vector<NamedPlace> table;
  for (const std::string_view name : kBodyNames) table.push_back({name, name});
  return make_set(table, rest);
}

std::vector<Landmark> superanimal_landmarks(const RestMesh& rest) {
  return make_set(kSuperAnimal, rest);
}

std::vector<Landmark> animal_kingdom_landmarks(const RestMesh& rest) {
  return make_set(kAnimalKingdom, rest);
}

std::vector<Eigen::Vector3f> landmark_points(const std::vector<Landmark>& landmarks, const Body& body) {
  std::vector<Eigen::Vector3f> points;
  for (const Landmark& landmark : landmarks) {
    points.push_back(landmark.keypoint >= 0 ? body.keypoints[static_cast<std::size_t>(landmark.keypoint)]
                     : landmark.vertex >= 0 ? body.vertices[static_cast<std::size_t>(landmark.vertex)]
                                            : Eigen::Vector3f(0.0F, 0.0F, 0.0F));
  }
  return points;
}

}  // namespace q3d::pipeline::world
