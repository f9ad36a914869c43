// The name of a keypoint is read as words: the side, the end of the body, and the part.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace q3d::loaders::keypoints {

enum class Side : std::uint8_t { none, left, right };
enum class End : std::uint8_t { none, front, back };
// Parts of the body that names use. Hoof, foot and toe are paws; wrist is carpus; ankle is tarsus.
enum class Part : std::uint8_t {
  none,
  eye,
  ear,
  ear_tip,
  nose,
  chin,
  mouth_corner,
  neck,
  withers,
  shoulder,
  elbow,
  carpus,
  hip,
  stifle,
  knee,
  tarsus,
  thigh,
  fetlock,
  paw,
  tail_base,
  tail_mid,
  tail_tip
};

struct KeypointWords {
  Side side = Side::none;
  End end = End::none;
  Part part = Part::none;
  // The name in lower case without the words for its side, joined by '_'. A keypoint and its mirror image
  // have the same one.
  std::string without_side;
};

// Reads "L_F_Paw", "hoof_fl", "leftFrontPaw", "Nearknee" and the like. Letter case and separators do not
// matter. Near is left and off is right, as riders say.
KeypointWords words_of(std::string_view name);

}  // namespace q3d::loaders::keypoints
