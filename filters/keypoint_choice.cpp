#include "filters/keypoint_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>

#include "manifests/digest.h"

namespace q3d::filters {

std::vector<std::size_t> shuffled_visible(const smal::CropKeypoints& annotated, std::uint64_t seed,
                                          const std::string& sample_id) {
  std::vector<std::size_t> visible;
  for (std::size_t k = 0; k < annotated.size(); ++k) {
    if (annotated[k].is_visible()) visible.push_back(k);
  }
  std::mt19937_64 random(
      std::stoull(manifests::sha256(fmt::format("{} {}", seed, sample_id)).substr(0, 16), nullptr, 16));
  // Fisher-Yates from the front. The remainder's bias is below 2^-59.
  for (std::size_t i = 0; i < visible.size(); ++i) {
    std::swap(visible[i], visible[i + random() % (visible.size() - i)]);
  }
  return visible;
}

KeypointFlags held_out_keypoints(const smal::CropKeypoints& annotated, double share, std::uint64_t seed,
                                 const std::string& sample_id) {
  if (!(share > 0.0 && share < 1.0)) {
    throw std::invalid_argument(
        fmt::format("the share of held-out keypoints: got {}, expected more than 0, less than 1", share));
  }
  const std::vector<std::size_t> visible = shuffled_visible(annotated, seed, sample_id);
  KeypointFlags held_out{};
  if (visible.size() < 2) return held_out;
  const auto wanted = static_cast<std::size_t>(std::lround(share * static_cast<double>(visible.size())));
  const std::size_t count = std::clamp(wanted, std::size_t{1}, visible.size() - 1);
  for (std::size_t i = 0; i < count; ++i) held_out[visible[i]] = true;
  return held_out;
}

}  // namespace q3d::filters
