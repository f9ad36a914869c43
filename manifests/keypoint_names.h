// The names of the 26 keypoints. Every array of keypoints has this order, which is Animal3D's.
#pragma once

#include <array>
#include <string_view>

#include "manifests/sample.h"

namespace q3d::manifests {

inline constexpr std::array<std::string_view, kNumKeypoints> kKeypointNames{"left_eye",
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

}  // namespace q3d::manifests
