// The sizes of SMAL's arrays.
#pragma once

#include <cstdint>

namespace q3d::smal {

inline constexpr std::int64_t kNumJoints = 35;
inline constexpr std::int64_t kNumBetas = 41;
inline constexpr std::int64_t kNumKeypoints = 26;
inline constexpr std::int64_t kNumVertices = 3889;
inline constexpr std::int64_t kNumFaces = 7774;

}  // namespace q3d::smal
