#include "loaders/topology.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace q3d::loaders {
namespace {

using Pairs = std::vector<std::pair<int, int>>;

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

// `sources` names, for each Animal3D keypoint in turn, the keypoint it is taken from; "-" is none.
Topology make(const std::string& name, const std::string& keypoints, const Pairs& mirrored,
              const std::string& sources) {
  Topology made{.name = name, .keypoints = words(keypoints), .flip = {}};
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
  const char* names =
      "left_eye right_eye chin left_front_paw right_front_paw left_back_paw right_back_paw "
      "tail_base left_front_thigh right_front_thigh left_back_thigh right_back_thigh "
      "left_shoulder right_shoulder left_front_knee right_front_knee left_back_knee "
      "right_back_knee neck tail_tip left_ear right_ear left_mouth_corner right_mouth_corner "
      "nose tail_mid";
  return make("animal3d26", names,
              {{0, 1}, {3, 4}, {5, 6}, {8, 9}, {10, 11}, {12, 13}, {14, 15}, {16, 17}, {20, 21}, {22, 23}},
              names);
}

// Names and mirror images: DeepLabCut's superanimal_quadruped project configuration. Map: the official code's
// (PRIMA's "quadruped80k" mapping, equal to FMPose3D's). Chin, shoulders and the middle of the tail have no
// counterpart and stay unlabelled; FMPose3D fills them by midpoints, which would be guesses as supervision.
Topology superanimal_quadruped39() {
  return make("superanimal_quadruped39",
              "nose upper_jaw lower_jaw mouth_end_right mouth_end_left right_eye right_earbase "
              "right_earend right_antler_base right_antler_end left_eye left_earbase left_earend "
              "left_antler_base left_antler_end neck_base neck_end throat_base throat_end back_base "
              "back_end back_middle tail_base tail_end front_left_thai front_left_knee front_left_paw "
              "front_right_thai front_right_knee front_right_paw back_left_paw back_left_thai "
              "back_right_thai back_left_knee back_right_knee back_right_paw belly_bottom "
              "body_middle_right body_middle_left",
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

// Names and mirror images: AP-10K. The map is ours, by measured heights: its "shoulder" and "hip" are at
// elbow and stifle level (our thighs), its "elbow" and "knee" are carpus and hock (our knees), as its README
// says of hoofed animals. Its "neck" is at the shoulder end, ours at the head end.
Topology ap10k17() {
  return make("ap10k17",
              "left_eye right_eye nose neck root_of_tail left_shoulder left_elbow left_front_paw "
              "right_shoulder right_elbow right_front_paw left_hip left_knee left_back_paw right_hip "
              "right_knee right_back_paw",
              {{0, 1}, {5, 8}, {6, 9}, {7, 10}, {11, 14}, {12, 15}, {13, 16}},
              "left_eye right_eye - left_front_paw right_front_paw left_back_paw right_back_paw "
              "root_of_tail left_shoulder right_shoulder left_hip right_hip - - left_elbow right_elbow "
              "left_knee right_knee neck - - - - - nose -");
}

// Names: the dataset's README. Map: published by AniMer's author.
Topology animalpose20_original() {
  return make("animalpose20_original",
              "left_eye right_eye nose left_ear right_ear left_front_elbow right_front_elbow "
              "left_back_elbow right_back_elbow left_front_knee right_front_knee left_back_knee "
              "right_back_knee left_front_paw right_front_paw left_back_paw right_back_paw throat "
              "withers tailbase",
              {{0, 1}, {3, 4}, {5, 6}, {7, 8}, {9, 10}, {11, 12}, {13, 14}, {15, 16}},
              "left_eye right_eye - left_front_paw right_front_paw left_back_paw right_back_paw "
              "tailbase left_front_elbow right_front_elbow left_back_elbow right_back_elbow - - "
              "left_front_knee right_front_knee left_back_knee right_back_knee - - left_ear right_ear - "
              "- nose -");
}

// The same keypoints in the order of mmpose's conversion.
Topology animalpose20_mmpose() {
  return make("animalpose20_mmpose",
              "L_Eye R_Eye L_EarBase R_EarBase Nose Throat TailBase Withers L_F_Elbow R_F_Elbow "
              "L_B_Elbow R_B_Elbow L_F_Knee R_F_Knee L_B_Knee R_B_Knee L_F_Paw R_F_Paw L_B_Paw R_B_Paw",
              {{0, 1}, {2, 3}, {8, 9}, {10, 11}, {12, 13}, {14, 15}, {16, 17}, {18, 19}},
              "L_Eye R_Eye - L_F_Paw R_F_Paw L_B_Paw R_B_Paw TailBase L_F_Elbow R_F_Elbow L_B_Elbow "
              "R_B_Elbow - - L_F_Knee R_F_Knee L_B_Knee R_B_Knee - - L_EarBase R_EarBase - - Nose -");
}

// Names: StanfordExtra's keypoint definitions (each leg from the paw up). The map is ours, by name.
Topology stanfordextra24() {
  return make("stanfordextra24",
              "left_front_paw left_front_middle left_front_top left_rear_paw left_rear_middle "
              "left_rear_top right_front_paw right_front_middle right_front_top right_rear_paw "
              "right_rear_middle right_rear_top tail_start tail_end left_ear_base right_ear_base nose "
              "chin left_ear_tip right_ear_tip left_eye right_eye withers throat",
              {{0, 6}, {1, 7}, {2, 8}, {3, 9}, {4, 10}, {5, 11}, {14, 15}, {18, 19}, {20, 21}},
              "left_eye right_eye chin left_front_paw right_front_paw left_rear_paw right_rear_paw "
              "tail_start left_front_top right_front_top left_rear_top right_rear_top - - "
              "left_front_middle right_front_middle left_rear_middle right_rear_middle - tail_end "
              "left_ear_base right_ear_base - - nose -");
}

// Names and map: the official code's AcinoSet converter. It sends the shoulders to the shoulders and drops
// the hips; DeepLabCut's table sends the same shoulders to the front thighs.
Topology acinoset20() {
  return make("acinoset20",
              "nose r_eye l_eye neck_base spine tail_base tail1 tail2 r_shoulder r_front_knee "
              "r_front_ankle l_shoulder l_front_knee l_front_ankle r_hip r_back_knee r_back_ankle l_hip "
              "l_back_knee l_back_ankle",
              {{1, 2}, {8, 11}, {9, 12}, {10, 13}, {14, 17}, {15, 18}, {16, 19}},
              "l_eye r_eye - l_front_ankle r_front_ankle l_back_ankle r_back_ankle tail_base - - - - "
              "l_shoulder r_shoulder l_front_knee r_front_knee l_back_knee r_back_knee neck_base tail2 "
              "- - - - nose tail1");
}

std::string folded(std::string_view name) {
  const auto first = name.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  std::string result(name.substr(first, name.find_last_not_of(" \t") - first + 1));
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

}  // namespace

std::span<const Topology> topologies() {
  static const std::array<Topology, 8> all{animal3d26(),
                                           superanimal_quadruped39(),
                                           animal_kingdom23(),
                                           ap10k17(),
                                           animalpose20_original(),
                                           animalpose20_mmpose(),
                                           stanfordextra24(),
                                           acinoset20()};
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

std::vector<int> order_in_file(const Topology& topology, std::span<const std::string> names_in_file) {
  std::vector<int> order(topology.keypoints.size(), -1);
  for (std::size_t k = 0; k < names_in_file.size(); ++k) {
    const std::string name = folded(names_in_file[k]);
    const auto found = std::find_if(topology.keypoints.begin(), topology.keypoints.end(),
                                    [&](const std::string& known) { return folded(known) == name; });
    const auto place = static_cast<std::size_t>(found - topology.keypoints.begin());
    if (found == topology.keypoints.end() || order[place] >= 0) {
      throw std::invalid_argument(fmt::format(
          "keypoint {} is named \"{}\", which {} {}", k, names_in_file[k],
          found == topology.keypoints.end() ? "is none of" : "stands twice among the", topology.name));
    }
    order[place] = static_cast<int>(k);
  }
  const auto missing = std::find(order.begin(), order.end(), -1);
  if (missing != order.end()) {
    throw std::invalid_argument(
        fmt::format("got {} keypoint names without \"{}\", expected the {} of {}", names_in_file.size(),
                    topology.keypoints[static_cast<std::size_t>(missing - order.begin())],
                    topology.keypoints.size(), topology.name));
  }
  return order;
}

manifests::Keypoints to_animal3d(const Topology& topology, std::span<const manifests::Keypoint> keypoints) {
  if (keypoints.size() != topology.keypoints.size()) {
    throw std::invalid_argument(fmt::format("{}: got {} keypoints, expected {}", topology.name,
                                            keypoints.size(), topology.keypoints.size()));
  }
  manifests::Keypoints mapped{};
  for (std::size_t i = 0; i < mapped.size(); ++i) {
    if (topology.source[i] >= 0) mapped[i] = keypoints[static_cast<std::size_t>(topology.source[i])];
  }
  return mapped;
}

}  // namespace q3d::loaders
