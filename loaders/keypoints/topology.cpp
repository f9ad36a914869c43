#include "loaders/keypoints/topology.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "manifests/keypoint_names.h"

namespace q3d::loaders::keypoints {
namespace {

using Pairs = std::vector<std::pair<int, int>>;

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

// `sources` names, for each Animal3D keypoint in turn, the keypoint from which it is taken; "-" means none.
Topology make(const std::string& name, const std::string& keypoints, const Pairs& mirrored,
              const std::string& sources) {
  Topology made{.name = name, .keypoints = words(keypoints), .flip = {}, .weights = {}};
  made.weights.assign(made.keypoints.size(), 1.0F);
  made.flip.resize(made.keypoints.size());
  std::iota(made.flip.begin(), made.flip.end(), 0);
  for (const auto& [left, right] : mirrored) {
    std::swap(made.flip[static_cast<std::size_t>(left)], made.flip[static_cast<std::size_t>(right)]);
  }
  const std::vector<std::string> source_names = words(sources);
  for (std::size_t i = 0; i < made.source.size(); ++i) {
    const auto found = std::find(made.keypoints.begin(), made.keypoints.end(), source_names.at(i));
    const bool known = found != made.keypoints.end();
    if (!known && source_names[i] != "-") {
      throw std::logic_error(fmt::format("topology {}: no keypoint is named \"{}\"", name, source_names[i]));
    }
    made.source[i] = known ? static_cast<int>(found - made.keypoints.begin()) : -1;
  }
  return made;
}

// Names: the official code's configuration (metadata.bodyparts), except 19 and 25, whose names are swapped
// there: its own vertex groups put 19 at the tip of the tail and 25 at its middle.
Topology animal3d26() {
  std::string names;
  for (const std::string_view name : manifests::kKeypointNames) {
    names.append(names.empty() ? "" : " ").append(name);
  }
  return make("animal3d26", names,
              {{0, 1}, {3, 4}, {5, 6}, {8, 9}, {10, 11}, {12, 13}, {14, 15}, {16, 17}, {20, 21}, {22, 23}},
              names);
}

// Names and mirror images: DeepLabCut's superanimal_quadruped project configuration. Map: the official code's
// (PRIMA's "quadruped80k" mapping, equal to FMPose3D's). Chin, shoulders and the middle of the tail have no
// counterpart and stay unlabelled; FMPose3D fills them by midpoints, which would be guesses as supervision.
Topology superanimal_quadruped39() {
  return make("superanimal_quadruped39",
              "nose upper_jaw lower_jaw mouth_end_right mouth_end_left right_eye right_earbase right_earend "
              "right_antler_base right_antler_end left_eye left_earbase left_earend left_antler_base "
              "left_antler_end neck_base neck_end throat_base throat_end back_base back_end back_middle "
              "tail_base tail_end front_left_thai front_left_knee front_left_paw front_right_thai "
              "front_right_knee front_right_paw back_left_paw back_left_thai back_right_thai back_left_knee "
              "back_right_knee back_right_paw belly_bottom body_middle_right body_middle_left",
              {{3, 4},
               {5, 10},
               {6, 11},
               {7, 12},
               {8, 13},
               {9, 14},
               {24, 27},
               {25, 28},
               {26, 29},
               {30, 35},
               {31, 32},
               {33, 34},
               {37, 38}},
              "left_eye right_eye - front_left_paw front_right_paw back_left_paw back_right_paw "
              "tail_base front_left_thai front_right_thai back_left_thai back_right_thai - - "
              "front_left_knee front_right_knee back_left_knee back_right_knee neck_base tail_end "
              "left_earbase right_earbase mouth_end_left mouth_end_right nose -");
}

// Names and mirror images: the dataset's README and its mmpose configuration. No official map is published;
// ours goes by name and by height above the ground measured on its horses and wolves: "Wrist" and "Ankle" are
// at the ground (paws), "Elbow" and "Knee" halfway (our knees), "Shoulder" at the withers (our shoulders) and
// "Hip" on the line of the back, where the 26 have nothing.
Topology animal_kingdom23() {
  return make("animal_kingdom23",
              "Head_Mid_Top Eye_Left Eye_Right Mouth_Front_Top Mouth_Back_Left Mouth_Back_Right "
              "Mouth_Front_Bottom Shoulder_Left Shoulder_Right Elbow_Left Elbow_Right Wrist_Left "
              "Wrist_Right Torso_Mid_Back Hip_Left Hip_Right Knee_Left Knee_Right Ankle_Left "
              "Ankle_Right Tail_Top_Back Tail_Mid_Back Tail_End_Back",
              {{1, 2}, {4, 5}, {7, 8}, {9, 10}, {11, 12}, {14, 15}, {16, 17}, {18, 19}},
              "Eye_Left Eye_Right Mouth_Front_Bottom Wrist_Left Wrist_Right Ankle_Left Ankle_Right "
              "Tail_Top_Back - - - - Shoulder_Left Shoulder_Right Elbow_Left Elbow_Right Knee_Left "
              "Knee_Right - Tail_End_Back - - Mouth_Back_Left Mouth_Back_Right Mouth_Front_Top "
              "Tail_Mid_Back");
}

}  // namespace

std::span<const Topology> topologies() {
  static const std::array<Topology, 3> all{animal3d26(), superanimal_quadruped39(), animal_kingdom23()};
  return all;
}

const Topology& topology(std::string_view name) {
  std::string known;
  for (const Topology& each : topologies()) {
    if (each.name == name) return each;
    known += (known.empty() ? "" : ", ") + each.name;
  }
  throw std::invalid_argument(fmt::format("keypoint topology: got \"{}\", expected one of {}", name, known));
}

manifests::Keypoints to_animal3d(const Topology& topology, std::span<const manifests::Keypoint> keypoints) {
  if (keypoints.size() != topology.keypoints.size()) {
    throw std::invalid_argument(fmt::format("{}: got {} keypoints, expected {}", topology.name,
                                            keypoints.size(), topology.keypoints.size()));
  }
  manifests::Keypoints mapped{};
  for (std::size_t i = 0; i < mapped.size(); ++i) {
    if (topology.source[i] < 0) continue;
    const auto here = static_cast<std::size_t>(topology.source[i]);
    mapped[i] = keypoints[here];
    mapped[i].weight *= topology.weights[here];
  }
  return mapped;
}

}  // namespace q3d::loaders::keypoints
