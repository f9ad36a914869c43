#include "pipeline/world/annotator.h"

#include <array>
#include <string>
#include <string_view>
#include <utility>

namespace q3d::pipeline::world {
namespace {

bool contains_any(const std::string& name, std::span<const std::string_view> parts) {
  for (const std::string_view part : parts) {
    if (name.find(part) != std::string::npos) return true;
  }
  return false;
}

// Returns whether a point belongs to a group of points that are confused together. The names are those of all
// three datasets.
bool in_group(const std::string& name, int group) {
  static constexpr std::array<std::string_view, 5> kFore{"front", "Elbow", "Wrist", "shoulder", "Shoulder"};
  static constexpr std::array<std::string_view, 4> kHind{"back_", "Knee", "Ankle", "Hip"};
  static constexpr std::array<std::string_view, 5> kFace{"eye", "Eye", "ear", "mouth", "Mouth"};
  switch (group) {
    case 0:
      return contains_any(name, kFore);
    case 1:
      return contains_any(name, kHind);
    case 2:
      return contains_any(name, kFace);
    default:
      return true;
  }
}

void swap_sides(std::vector<Label>& labels, const std::vector<Landmark>& landmarks, int group) {
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const auto partner = static_cast<std::size_t>(landmarks[i].mirror);
    if (partner > i && in_group(landmarks[i].name, group)) std::swap(labels[i], labels[partner]);
  }
}

}  // namespace

std::vector<Label> annotate(const std::vector<Landmark>& landmarks, std::span<const SeenLandmark> seen,
                            double box_side_px, const LabelHabits& habits, manifests::Rng& rng) {
  std::vector<Label> labels(landmarks.size());
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const double rate = seen[i].occluded      ? habits.occluded
                        : seen[i].self_hidden ? habits.self_hidden
                                              : habits.visible;
    const double deviation = habits.jitter * box_side_px * (landmarks[i].vague ? habits.vague_factor : 1.0) *
                             (seen[i].occluded || seen[i].self_hidden ? 1.5 : 1.0);  // a guess is less exact
    const bool chosen = rng.chance(rate);
    const double dx = rng.normal(0.0, deviation), dy = rng.normal(0.0, deviation);
    labels[i] = {seen[i].px.x() + dx, seen[i].px.y() + dy, chosen && seen[i].exists && seen[i].inside};
  }
  if (rng.chance(habits.swapped)) swap_sides(labels, landmarks, rng.below(4));
  return labels;
}

}  // namespace q3d::pipeline::world
